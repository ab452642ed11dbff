/* See hand_written.c. */
#ifndef HAND_WRITTEN_H
#define HAND_WRITTEN_H

typedef struct { double sigma0, sigma1, fs, fc, vs, sigma2; } lugre_parameters;
typedef struct { double k[4], alpha[4], c, fs, fc, vs, sigma2; } gms_parameters;
typedef struct { double force[4], mode[4]; } gms_state;
typedef struct { double fs, fc, vs, sigma2; } stribeck_parameters;

double lugre_hand(double v0, double v1, double dt, double *state, const lugre_parameters *p);
double gms_hand(double v0, double v1, double dt, gms_state *state, const gms_parameters *p);
double stribeck_hand(double v, double applied, const stribeck_parameters *p);

#endif
