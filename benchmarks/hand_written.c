/* LuGre, GMS with 4 elements and Stribeck friction as a person would write them: the equations and steps of the package. */
#include "hand_written.h"

#include <math.h>

static double curve(double v, double fs, double fc, double vs)
{
    double x = v / vs;
    return fc + (fs - fc) * exp(-x * x);
}

static double bend(double v0, double v1, double dt, double z, double s0, double s1, const lugre_parameters *p)
{
    double vm = 0.5 * (v0 + v1);
    double q = p->sigma0 * dt * fabs(v0) / s0;
    if (v0 != v1) {
        double sm = curve(vm, p->fs, p->fc, p->vs);
        q = p->sigma0 * dt / 6.0 * (fabs(v0) / s0 + 4.0 * fabs(vm) / sm + fabs(v1) / s1);
    }
    if (vm < 0.0) {
        s0 = -s0;
        s1 = -s1;
    }
    double gain = -expm1(-q);
    double follow = (q > 1e-4) ? 1.0 - gain / q : 0.5 * q;
    return z * (1.0 - gain) + (s0 * gain + (s1 - s0) * follow) / p->sigma0;
}

double lugre_hand(double v0, double v1, double dt, double *state, const lugre_parameters *p)
{
    double z = *state;
    double s1 = curve(v1, p->fs, p->fc, p->vs);
    double s0 = (v0 == v1) ? s1 : curve(v0, p->fs, p->fc, p->vs);
    if (v0 * v1 < 0.0) {
        double part = dt * v0 / (v0 - v1);
        z = bend(v0, 0.0, part, z, s0, p->fs, p);
        z = bend(0.0, v1, dt - part, z, p->fs, s1, p);
    } else {
        z = bend(v0, v1, dt, z, s0, s1, p);
    }
    *state = z;
    return p->sigma0 * z + p->sigma1 * (v1 - p->sigma0 * fabs(v1) / s1 * z) + p->sigma2 * v1;
}

static void slide(double v0, double v1, double dt, double s0, double s1, gms_state *state, const gms_parameters *p)
{
    double vm = 0.5 * (v0 + v1);
    if (vm == 0.0) {
        return;
    }
    double direction = (vm < 0.0) ? -1.0 : 1.0;
    double sm = curve(vm, p->fs, p->fc, p->vs);
    double slip = p->c * dt / 6.0 * (1.0 / s0 + 4.0 / sm + 1.0 / s1);
    for (int i = 0; i < 4; i++) {
        double force = state->force[i], mode = state->mode[i], part = 1.0, start = s0;
        if (mode * direction < 0.0) {
            mode = 0.0;
        }
        if (mode == 0.0) {
            double gap0 = p->alpha[i] * s0 - direction * force;
            double stuck = force + p->k[i] * vm * dt;
            double gap1 = p->alpha[i] * s1 - direction * stuck;
            if (gap1 > 0.0) {
                force = stuck;
                part = 0.0;
            } else {
                mode = direction;
                if (gap0 > 0.0) {
                    part = gap1 / (gap1 - gap0);
                    force += (1.0 - part) * (stuck - force);
                    start = s0 + (1.0 - part) * (s1 - s0);
                }
            }
        }
        if (part > 0.0) {
            double q = part * slip;
            double gain = -expm1(-q);
            double follow = (q > 1e-4) ? 1.0 - gain / q : 0.5 * q;
            force = force * (1.0 - gain) + p->alpha[i] * mode * (start * gain + (s1 - start) * follow);
        }
        state->force[i] = force;
        state->mode[i] = mode;
    }
}

double gms_hand(double v0, double v1, double dt, gms_state *state, const gms_parameters *p)
{
    double s0 = curve(v0, p->fs, p->fc, p->vs), s1 = curve(v1, p->fs, p->fc, p->vs);
    if (v0 * v1 < 0.0) {
        double part = dt * v0 / (v0 - v1);
        slide(v0, 0.0, part, s0, p->fs, state, p);
        for (int i = 0; i < 4; i++) {
            state->mode[i] = 0.0;
        }
        slide(0.0, v1, dt - part, p->fs, s1, state, p);
    } else {
        if (v0 == 0.0) {
            for (int i = 0; i < 4; i++) {
                state->mode[i] = 0.0;
            }
        }
        slide(v0, v1, dt, s0, s1, state, p);
    }
    if (v1 == 0.0) {
        for (int i = 0; i < 4; i++) {
            state->mode[i] = 0.0;
        }
    }
    return p->sigma2 * v1 + state->force[0] + state->force[1] + state->force[2] + state->force[3];
}

double stribeck_hand(double v, double applied, const stribeck_parameters *p)
{
    if (v == 0.0) {
        return fmin(fmax(applied, -p->fs), p->fs);
    }
    return copysign(curve(v, p->fs, p->fc, p->vs), v) + p->sigma2 * v;
}
