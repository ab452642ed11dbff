/* The loop's state, its command, and the laws in it: see baseline.c.
 *
 * SPDX-License-Identifier: BSD-3-Clause
 */
#ifndef BASELINE_LAWS_H
#define BASELINE_LAWS_H

#include "baseline_flow.h"

enum { NONE, COULOMB, STRIBECK, LUGRE, GMS };
#ifndef MODEL
#define MODEL NONE /* the law that is fed back */
#endif
#ifndef INTEGRAL
#define INTEGRAL 0 /* whether the controller integrates */
#endif
#ifndef TABLE
#define TABLE 0 /* whether a torque is fed forward from a table */
#endif
#ifndef CONTROL
#define CONTROL 1 /* whether steps are chosen by their error, or only by how quickly the corrector converges */
#endif

enum {
  SIDES = MODEL == NONE ? 1 : 2,
  GMS_SIDES = MODEL == GMS ? 2 : 1,
  BENT = MODEL == STRIBECK || MODEL == LUGRE, /* the flow follows a force from step to step */
  MOST = 8,
  DEEPEST = 25,
  CELL = 7
};

typedef struct {
  double fs, fc, vs, viscous;
  double count, stiffness[4], share[4], attraction;      /* GMS */
  double sigma0, lag;                                    /* LuGre: lag is sigma1/sigma0 */
  double steepness, layer;                               /* Stribeck: the slope at rest, and where it ends */
} Law;

typedef struct {
  double inertia, kp, ki, kd;
  double filtered, amplitude, rate;                      /* sine: rad/s; filtered step: 1/s */
  Law law[2];                                            /* the plant's, and the one fed back */
} Loop;

typedef struct { double r, dr, goal, speed; } Command;   /* torque by time alone, its slope; reference */

typedef struct {                                         /* what slips of a law, as one force S */
  double share, s, ds, start, exponent, q, q_mid, q_end, s_mid, s_end, ds_end, spring, offset, damping;
} Slip;

typedef struct {
  const Loop *loop;
  const double *cells;
  int cell, last_cell, alike;                            /* alike: both laws have one curve */
  double low, high;                                      /* commands are taken inside [low, high] */
  int count[2], slips[MOST], watched, corrected, inside, calm, unseen;
  double force[MOST], offset[MOST], load[MOST], slope[MOST];
  double t, theta, v, sigma, base, integral, added, narrow, seen;
  double even_stiffness, even_damping, even_base;
  Slip slip[2];
  Linear lin;
  Matrix halves[DEEPEST], between;                       /* flows over half a step of every level, and over a row, */
  unsigned known;                                        /* where its bit is set */
  Command command;
} State;

typedef struct {
  double h, integral_end, error;
  int rounds;
  Motion mid, end, released;
  Cubic c;
} Stretch;

enum { BETWEEN = 31 };
static const double WEIGHT[2] = {1.0, -1.0};

static inline double curve(const Law *p, double v) {
  double x = v / p->vs;
  return p->fc + (p->fs - p->fc) * exp(-x * x);
}

/* The curve of both laws at v. */
static inline void curves(const State *s, double v, double out[2]) {
  out[0] = curve(&s->loop->law[0], v);
  if (SIDES == 2) out[1] = s->alike ? out[0] : curve(&s->loop->law[1], v);
}

static inline Command command_at(State *s, double t) {
  const Loop *p = s->loop;
  if (TABLE) t = fmin(fmax(t, s->low), s->high);
  double a;
  Command c;
  if (p->filtered != 0.0) {
    double x = t * p->rate, decay = exp(-x);
    c.goal = p->amplitude * (1.0 - (1.0 + x) * decay);
    c.speed = p->amplitude * p->rate * x * decay;
    a = p->amplitude * p->rate * p->rate * (1.0 - x) * decay;
  } else {
    double si, co;
    sincos(p->rate * t, &si, &co);
    c.goal = p->amplitude * (1.0 - co);
    c.speed = p->amplitude * p->rate * si;
    a = p->amplitude * p->rate * p->rate * co;
  }
  c.r = p->kp * c.goal + p->kd * c.speed;
  c.dr = p->kp * c.speed + p->kd * a;
  if (TABLE) {
    const double *cell = s->cells + CELL * s->cell;
    while (s->cell < s->last_cell && t >= cell[CELL]) cell += CELL, s->cell++;
    while (s->cell > 0 && t < cell[0]) cell -= CELL, s->cell--;
    double x = (t - cell[0]) * cell[1];
    c.r += cell[2] + x * (cell[3] + x * (cell[4] + x * (cell[5] + x * cell[6])));
    c.dr += cell[1] * (cell[3] + x * (2.0 * cell[4] + x * (3.0 * cell[5] + x * 4.0 * cell[6])));
  }
  return c;
}

/* ---- GMS: the slipping elements relax towards the curve; Lobatto IIIA of fourth order ---- */

static inline void relax(Slip *p, double goal_mid, double goal_end, double a_mid, double a_end, double h) {
  double right_mid = p->s + h / 24.0 * (5.0 * p->ds + 8.0 * goal_mid - goal_end);
  double right_end = p->s + h / 6.0 * (p->ds + 4.0 * goal_mid + goal_end);
  double m11 = 1.0 + h * a_mid / 3.0, m12 = -h * a_end / 24.0;
  double m21 = 2.0 * h * a_mid / 3.0, m22 = 1.0 + h * a_end / 6.0;
  double inverse = 1.0 / (m11 * m22 - m12 * m21);
  p->s_mid = (right_mid * m22 - m12 * right_end) * inverse;
  p->s_end = (m11 * right_end - m21 * right_mid) * inverse;
  p->ds_end = goal_end - a_end * p->s_end;
}

static inline void gms_terms(State *s, int side, double h, const double mid[2], const double end[2], double *u2, double *u3) {
  Slip *p = &s->slip[side];
  double c = s->loop->law[side].attraction, goal = c * p->share * s->sigma;
  p->q_mid = 1.0 / mid[side];
  p->q_end = 1.0 / end[side];
  relax(p, goal, goal, c * p->q_mid, c * p->q_end, h);
  upper(p->s, p->ds, p->s_end, p->ds_end, 1.0 / h, u2, u3);
}

/* ---- LuGre: F = G (theta - theta_0) + S, with the spring G in the flow ---- */

static inline double curve_slope(const Law *p, double v, double s) { return -2.0 * v / (p->vs * p->vs) * (s - p->fc); }

static inline double bend_lugre(State *s, double h, double total) {
  const Law *law = &s->loop->law[1];
  Slip *p = &s->slip[1];
  double force = p->s + p->spring * s->theta + p->offset, level = curve(law, s->v), v = s->v;
  double decay = law->sigma0 * s->sigma * v / level, least = 0.01 * s->loop->inertia / (h * h);
  double filled = s->sigma * force / level * (1.0 - v * curve_slope(law, v, level) / level);
  double g = law->sigma0 * (1.0 - filled) / (1.0 + 0.5 * decay * h);
  if (fabs(total - g) < least) g = total - copysign(least, total - g);
  p->spring = g;
  p->offset = -g * s->theta;
  p->s = force;
  p->ds = (law->sigma0 - g) * v - decay * force;
  return g;
}

static inline void lugre_terms(State *s, const Stretch *y, double h, const double mid[2], const double end[2], double *u2,
                               double *u3) {
  Slip *p = &s->slip[1];
  double k = s->loop->law[1].sigma0, g = p->spring;
  double a_mid = k * s->sigma * y->mid.velocity / mid[1], a_end = k * s->sigma * y->end.velocity / end[1];
  double goal_mid = (k - g) * y->mid.velocity - a_mid * g * (y->mid.position - s->theta);
  double goal_end = (k - g) * y->end.velocity - a_end * g * (y->end.position - s->theta);
  p->q_mid = a_mid;
  relax(p, goal_mid, goal_end, a_mid, a_end, h);
  upper(p->s, p->ds, p->s_end, p->ds_end, 1.0 / h, u2, u3);
}

/* ---- Stribeck outside its layer: F = sigma s(v) = B v + S, with the damper B in the flow ---- */

static inline double bend_stribeck(State *s) {
  const Law *law = &s->loop->law[1];
  Slip *p = &s->slip[1];
  double level = curve(law, s->v);
  p->damping = s->sigma * curve_slope(law, s->v, level);
  p->s = s->sigma * level - p->damping * s->v;
  return p->damping;
}

static inline void stribeck_terms(State *s, const Stretch *y, double h, const double mid[2], const double end[2],
                                  double *u2, double *u3) {
  Slip *p = &s->slip[1];
  double per_h = 1.0 / h;
  double m = s->sigma * mid[1] - p->damping * y->mid.velocity - p->s;
  double e = s->sigma * end[1] - p->damping * y->end.velocity - p->s;
  p->s_end = p->s + e;
  p->ds_end = (4.0 * e - 8.0 * m) * per_h;
  *u2 = (8.0 * m - e) * per_h * per_h;
  *u3 = (2.0 * e - 8.0 * m) * per_h * per_h * per_h;
}

#endif
