/* One stretch: predictor, corrector, and what it may be wrong by: see baseline.c.
 *
 * SPDX-License-Identifier: BSD-3-Clause
 */
#ifndef BASELINE_STEP_H
#define BASELINE_STEP_H

#include "baseline_laws.h"

enum { MOST_ROUNDS = BENT || INTEGRAL || CONTROL ? 5 : 3, FEW_ROUNDS = BENT || INTEGRAL ? 3 : 2 };
static const double UNCHANGED = CONTROL ? 0.01 : 0.1, BUMP = 8.0 / 15.0, NOT_CONVERGED = 1e9;

typedef struct { double p0, p1, p2, p3; } Forcing;

static void slip_terms(State *s, const Stretch *y, Forcing *p, double h, double bent) {
  double mid[2], end[2], u2, u3;
  int slides = s->slip[0].share > 0.0 || (MODEL == GMS && s->slip[1].share > 0.0);
  if (!slides && MODEL != LUGRE && !(MODEL == STRIBECK && !s->inside)) return;
  curves(s, y->mid.velocity, mid);
  curves(s, y->end.velocity, end);
  for (int side = 0; side < GMS_SIDES; side++)
    if (s->slip[side].share > 0.0) {
      gms_terms(s, side, h, mid, end, &u2, &u3);
      p->p2 -= bent * WEIGHT[side] * u2;
      p->p3 -= bent * WEIGHT[side] * u3;
    }
  if (MODEL == LUGRE) {
    double lag = s->loop->law[1].lag;
    lugre_terms(s, y, h, mid, end, &u2, &u3);
    p->p1 += bent * 2.0 * lag * u2;
    p->p2 += bent * (u2 + 3.0 * lag * u3);
    p->p3 += bent * u3;
  }
  if (MODEL == STRIBECK && !s->inside) {
    stribeck_terms(s, y, h, mid, end, &u2, &u3);
    p->p2 += bent * u2;
    p->p3 += bent * u3;
  }
}

/* Torque of the integral controller. The integral of the position follows from the equation of motion. */
static double integral_terms(State *s, Stretch *y, Command middle, Command next, Forcing *p, double impulse, double h) {
  const Linear *l = &s->lin;
  const Command *c = &s->command;
  double travelled = (impulse - l->damping * (y->end.position - s->theta) - l->inertia * (y->end.velocity - s->v)) / l->stiffness;
  double wanted = h / 30.0 * (7.0 * (c->goal + next.goal) + 16.0 * middle.goal) + h * h / 60.0 * (c->speed - next.speed);
  double i0 = s->integral, i1 = i0 + wanted - travelled, u2, u3, ki = s->loop->ki;
  double e0 = c->goal - s->theta, e_mid = middle.goal - y->mid.position, e1 = next.goal - y->end.position;
  double i_mid = i0 + 0.25 * h * (e0 + e_mid)
                 + h * h / 48.0 * (c->speed - s->v - middle.speed + y->mid.velocity);
  upper(i0, e0, i1, e1, 1.0 / h, &u2, &u3);
  y->integral_end = i1;
  /* The cubic is lifted by the mean of the bump that it leaves out, so that the impulse is right. */
  double misfit = ki * (i_mid - 0.5 * (i0 + i1) - 0.125 * h * (e0 - e1));
  p->p0 += BUMP * misfit;
  p->p2 += ki * u2;
  p->p3 += ki * u3;
  return misfit;
}

static double added_terms(State *s, const Stretch *y, Forcing *p, double h, double bent) {
  double u2, u3, x0 = s->theta, x1 = y->end.position, v0 = s->v, v1 = y->end.velocity;
  upper(x0, v0, x1, v1, 1.0 / h, &u2, &u3);
  double misfit = s->added * (y->mid.position - 0.5 * (x0 + x1) - 0.125 * h * (v0 - v1));
  p->p0 += BUMP * misfit;
  p->p2 += bent * s->added * u2;
  p->p3 += bent * s->added * u3;
  return misfit;
}

/* What the slipping forces are wrong by: at the end, and between the nodes. Lobatto's rule takes dS/dt as a parabola. */
static double slip_error(const State *s, const Stretch *y, double *between) {
  const Linear *l = &s->lin;
  double h = y->h, total = 0.0, level[2] = {1.0, 1.0}, last[2];
  Motion start = {s->theta, s->v};
  double a0 = acceleration(l, &y->c, 0.0, start), a1 = acceleration(l, &y->c, 0.5 * h, y->mid);
  double v = 0.5 * (s->v + y->mid.velocity) + 0.0625 * h * (a0 - a1);
  *between = 0.0;
  if (s->slip[0].share > 0.0 || MODEL == LUGRE || (MODEL == GMS && s->slip[1].share > 0.0)) curves(s, v, level);
  for (int side = 0; side < (MODEL == LUGRE ? 2 : GMS_SIDES); side++) {
    const Slip *q = &s->slip[side];
    const Law *law = &s->loop->law[side];
    double force = hermite(q->s, q->ds, q->s_end, q->ds_end, h, 0.25 * h), slope, middle;
    if (MODEL == LUGRE && side == 1) {
      double k = law->sigma0, g = q->spring;
      double theta = 0.5 * (s->theta + y->mid.position) + 0.0625 * h * (s->v - y->mid.velocity);
      slope = (k - g) * v - k * s->sigma * v / level[1] * (force + g * (theta - s->theta));
      middle = (k - g) * y->mid.velocity - q->q_mid * (q->s_mid + g * (y->mid.position - s->theta));
    } else {
      if (q->share <= 0.0) continue;
      slope = law->attraction * (q->share * s->sigma - force / level[side]);
      middle = law->attraction * (q->share * s->sigma - q->q_mid * q->s_mid);
    }
    double off = fabs(slope - (0.375 * q->ds + 0.75 * middle - 0.125 * q->ds_end));
    total += MODEL == LUGRE && side == 1 ? 4.0 * off : off;
    if (MODEL == LUGRE && side == 1) *between += law->lag * off;
  }
  if (MODEL == STRIBECK && !s->inside) {
    const Slip *q = &s->slip[1];
    double a2 = acceleration(l, &y->c, h, y->end);
    double w = 0.5 * (y->mid.velocity + y->end.velocity) + 0.0625 * h * (a1 - a2);
    curves(s, w, last);
    *between += fabs(s->sigma * last[1] - q->damping * w - hermite(q->s, 0.0, q->s_end, q->ds_end, h, 0.75 * h));
  }
  return h / 3.0 * total;
}

/* Error in position, rad; the forcing is wrong by `misfit` in the middle. */
static double error_of(const State *s, const Stretch *y, double misfit) {
  double h = y->h, per_j = 1.0 / s->lin.inertia, k = fabs(s->lin.stiffness), per_root = sqrt(per_j / k), between;
  double moves = fmin(h * (0.05 * h * per_j + 0.02 * per_root), 0.5 / k);
  double error = misfit * moves;
  if (s->corrected) {
    double bump = slip_error(s, y, &between);
    error += between * fmin(h * (0.1 * h * per_j + 0.25 * per_root), 0.5 / k);
    double slip = bump * (moves + 0.5 * fmin(25e-6 * per_j, 1.0 / k));
    error += s->calm ? 0.2 * slip : slip;
  }
  return error;
}

/* Whether a slipping force would pass the bend of s(v) near rest unseen between start, middle and end. */
static int hides_curve(const State *s, const Stretch *y) {
  if (!s->watched || MODEL == COULOMB) return 0;
  double v0 = s->v, v1 = y->mid.velocity, v2 = y->end.velocity, scale = s->loop->law[0].vs;
  double slowest = v0 * v1 < 0.0 || v1 * v2 < 0.0 ? 0.0 : fmin(fmin(fabs(v0), fabs(v1)), fabs(v2));
  return fmax(fabs(v1 - v0), fabs(v2 - v1)) > scale && slowest < 3.0 * scale;
}

/* Moves over h; writes the error and the rounds that the corrector took. */
static void correct(State *s, Stretch *y, Command middle, Command next, Matrix half, double h, double tol) {
  Matrix full = twice(half);
  const Linear *l = &s->lin;
  Forcing start = {s->command.r - s->base, s->command.dr, 0.0, 0.0};
  double bent = 1.0;
  upper(s->command.r, s->command.dr, next.r, next.dr, 1.0 / h, &start.p2, &start.p3);
  if (MODEL == STRIBECK) {
    /* In a moment the upper terms are rounding errors, or a kink that the particular solution blows up. */
    double lag = l->damping / l->stiffness;
    if (h < 2e-8 || fabs(start.p3 * lag * lag * lag) > 1e5 * fabs(l->stiffness)) {
      bent = start.p2 = start.p3 = 0.0;
      start.p1 = (next.r - s->command.r) / h;
    }
  }
  for (int side = 0; side < SIDES; side++) {
    const Slip *q = &s->slip[side];
    start.p0 -= WEIGHT[side] * q->s;
    if (side < GMS_SIDES || MODEL == LUGRE) start.p1 -= WEIGHT[side] * q->ds;
    if (side == 1 && MODEL == LUGRE) start.p0 += s->loop->law[1].lag * q->ds;
  }
  if (INTEGRAL) {
    start.p0 += s->loop->ki * s->integral;
    start.p1 += s->loop->ki * (s->command.goal - s->theta);
  }
  if (MODEL == STRIBECK) {
    start.p0 += s->added * s->theta;
    start.p1 += s->added * s->v;
  }
  double off = CONTROL ? middle.r - 0.5 * (s->command.r + next.r) - 0.125 * h * (s->command.dr - next.dr) : 0.0;
  double misfit = fabs(off);
  start.p0 += bent * BUMP * off;
  Forcing p = start;
  y->h = h;
  y->rounds = 0;
  for (int round = 0;; round++) {
    Motion before = y->end;
    y->c = particular(l, p.p0, p.p1, p.p2, p.p3);
    y->released = (Motion){s->theta - y->c.c0, s->v - y->c.c1};
    y->mid = moved(&y->c, half, 0.5 * h, y->released);
    y->end = moved(&y->c, full, h, y->released);
    if (!s->corrected) break;
    if (CONTROL && !round && hides_curve(s, y)) goto failed;
    double change = fmax(fabs(y->end.position - before.position), 1e-3 * fabs(y->end.velocity - before.velocity));
    y->rounds = round;
    if (round && change < fmax(UNCHANGED * tol, fmax(1e-14, 4e-16 * fabs(y->c.c0)))) break;
    if (round == MOST_ROUNDS && change < 1e-13) break;
    if (round == MOST_ROUNDS || !(change < 1e300)) goto failed;
    double impulse = h * (p.p0 + h * (0.5 * p.p1 + h * (p.p2 / 3.0 + h * 0.25 * p.p3)));
    p = start;
    slip_terms(s, y, &p, h, bent);
    if (INTEGRAL) misfit = fabs(off) + fabs(integral_terms(s, y, middle, next, &p, impulse, h));
    if (MODEL == STRIBECK && s->added != 0.0) misfit = fabs(off) + fabs(added_terms(s, y, &p, h, bent));
  }
  y->error = CONTROL ? error_of(s, y, misfit) : 0.0;
  return;
failed:
  y->error = NOT_CONVERGED;
}

#endif
