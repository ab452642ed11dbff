/* The exact integrator in C: what the compiled Python kernel is measured against.
 *
 * J v' = T_m - T_f on a sinusoid from rest, PD control, a GMS contact (thesis eqs. 2.16 to 2.18), and one of no
 * compensation, LuGre feedforward, GMS feedback. Between events the motion is a cubic (forced) plus a 2x2 matrix
 * exponential (free); the slipping elements of a contact collapse to one scalar, advanced by Lobatto's rule of
 * fourth order and coupled by a corrector; break-aways and reversals are located on the exact flow. Steps are the
 * longest one halved some times, as long as the corrector converges quickly; there is no other control of errors.
 *
 * SPDX-License-Identifier: BSD-3-Clause
 */
#include <math.h>

#define MOST 16
#define DEEPEST 24
enum { NONE = 0, LUGRE_FEEDFORWARD = 1, GMS_FEEDBACK = 2 };

typedef struct {
  double count, stiffness[8], share[8], attraction, fs, fc, vs, viscous;
} Contact;

typedef struct {
  double inertia, kp, kd, amplitude, omega, compensation;
  Contact plant, model;
  double sigma0, sigma1;
} Loop;

typedef struct { double a, b, c, d; } Matrix;            /* flow of (position, velocity) */
typedef struct { double c0, c1, c2, c3; } Cubic;
typedef struct { double inertia, damping, stiffness, decay, square, discriminant, frequency; } Linear;
typedef struct { double r, dr, z; } Command;             /* torque by time alone, slope, bristle */
typedef struct { double weight, share, s, ds, start, exponent, q, q_mid, q_end, s_end, ds_end, per_vs; } Slip;
typedef struct { double h, theta_mid, v_mid, theta_end, v_end, free_position, free_velocity; Cubic c; } Stretch;

typedef struct {
  const Loop *loop;
  int sides, first[3], slips[MOST], any;
  double force[MOST], offset[MOST], load[MOST], slope[MOST], t, theta, v, sigma, base;
  Slip slip[2];
  Linear lin;
  Matrix halves[DEEPEST];    /* flows over half a step of every level, */
  unsigned known;            /* where its bit is set */
  Command command;
} State;

static const Contact *contact(const State *s, int side) { return side ? &s->loop->model : &s->loop->plant; }

static double curve(const State *s, int side, double v) {
  const Contact *p = contact(s, side);
  double x = v * s->slip[side].per_vs;
  return p->fc + (p->fs - p->fc) * exp(-x * x);
}

static Matrix flow(const Linear *l, double x) {
  double e = 1.0, c, s;
  if (l->discriminant > 0.0) {
    double si;
    e = exp(-l->decay * x);
    sincos(l->frequency * x, &si, &c);
    s = si / l->frequency;
  } else {
    double slow = exp((l->frequency - l->decay) * x), fast = exp(-(l->frequency + l->decay) * x);
    c = 0.5 * (slow + fast);
    s = l->frequency > 1e-9 ? 0.5 * (slow - fast) / l->frequency : x * slow;
  }
  return (Matrix){e * (c + l->decay * s), e * s, -e * l->square * s, e * (c - l->decay * s)};
}

static Matrix twice(Matrix m) {
  double trace = m.a + m.d;
  return (Matrix){m.a * m.a + m.b * m.c, m.b * trace, m.c * trace, m.d * m.d + m.b * m.c};
}

static Cubic particular(const Linear *l, double p0, double p1, double p2, double p3) {
  double inverse = 1.0 / l->stiffness;
  Cubic c;
  c.c3 = p3 * inverse;
  c.c2 = (p2 - 3.0 * l->damping * c.c3) * inverse;
  c.c1 = (p1 - 2.0 * l->damping * c.c2 - 6.0 * l->inertia * c.c3) * inverse;
  c.c0 = (p0 - l->damping * c.c1 - 2.0 * l->inertia * c.c2) * inverse;
  return c;
}

static void move(const Stretch *p, Matrix m, double x, double *theta, double *v) {
  const Cubic *c = &p->c;
  *theta = c->c0 + x * (c->c1 + x * (c->c2 + x * c->c3)) + m.a * p->free_position + m.b * p->free_velocity;
  *v = c->c1 + x * (2.0 * c->c2 + x * 3.0 * c->c3) + m.c * p->free_position + m.d * p->free_velocity;
}

static double acceleration(const Linear *l, const Stretch *p, double x, double theta, double v) {
  const Cubic *c = &p->c;
  double free_theta = theta - (c->c0 + x * (c->c1 + x * (c->c2 + x * c->c3)));
  double free_v = v - (c->c1 + x * (2.0 * c->c2 + x * 3.0 * c->c3));
  return 2.0 * c->c2 + 6.0 * c->c3 * x - l->square * free_theta - 2.0 * l->decay * free_v;
}

static double hermite(double y0, double d0, double y1, double d1, double h, double x) {
  double s = x / h, r = 1.0 - s;
  return r * r * (1.0 + 2.0 * s) * y0 + s * s * (3.0 - 2.0 * s) * y1 + s * r * h * (r * d0 - s * d1);
}

/* ---- the command: PD on the sinusoid, and the bristle of the feedforward, relaxed exponentially ---- */

static void bristle(const Loop *p, double t, double *v, double *rate, double *steady, double *slope) {
  double si, co;
  sincos(p->omega * t, &si, &co);
  *v = p->amplitude * p->omega * si;
  double x = *v / p->model.vs, peak = (p->model.fs - p->model.fc) * exp(-x * x), s = p->model.fc + peak;
  *rate = p->sigma0 * fabs(*v) / s;
  *steady = s / p->sigma0;
  *slope = -peak * 2.0 * x / p->model.vs * p->amplitude * p->omega * p->omega * co / p->sigma0;
}

static Command command_after(const Loop *p, double t, double z, double h) {
  double si, co, t1 = t + h, w = p->omega;
  sincos(w * t1, &si, &co);
  double goal = p->amplitude * (1.0 - co), v = p->amplitude * w * si, a = p->amplitude * w * w * co;
  Command out = {p->kp * goal + p->kd * v, p->kp * v + p->kd * a, z};
  if (p->compensation == LUGRE_FEEDFORWARD) {
    double v0, r0, s0, d0, vm, rm, sm, dm, v1, r1, s1, d1;
    bristle(p, t, &v0, &r0, &s0, &d0);
    bristle(p, t + 0.5 * h, &vm, &rm, &sm, &dm);
    bristle(p, t1, &v1, &r1, &s1, &d1);
    double sign = vm >= 0.0 ? 1.0 : -1.0, exponent = h / 6.0 * (r0 + 4.0 * rm + r1), decay = exp(-exponent);
    double lag = exponent > 1e-4 ? (1.0 - decay) / exponent : 1.0 - 0.5 * exponent;
    out.z = sign * s1 + (z - sign * s0) * decay - sign * dm * h * lag;
    double dz = v1 - r1 * out.z;
    out.r += p->sigma0 * out.z + p->sigma1 * dz + p->model.viscous * v1;
    out.dr += p->sigma0 * dz + p->model.viscous * a;
    if (h > 0.0) out.dr += p->sigma1 * (dz - (v0 - r0 * z)) / h;
  }
  return out;
}

/* ---- modes ---- */

static void arrange(State *s) {
  const Loop *p = s->loop;
  double stiffness = p->kp, damping = p->kd;
  s->base = 0.0;
  s->any = 0;
  s->known = 0;
  for (int side = 0; side < s->sides; side++) {
    const Contact *law = contact(s, side);
    Slip *slip = &s->slip[side];
    slip->share = slip->s = slip->exponent = slip->ds = 0.0;
    damping += slip->weight * law->viscous;
    for (int i = s->first[side]; i < s->first[side + 1]; i++) {
      double k = law->stiffness[i - s->first[side]];
      if (s->slips[i]) {
        slip->share += law->share[i - s->first[side]];
        slip->s += s->force[i];
      } else {
        s->offset[i] = s->force[i] - k * s->theta;
        s->load[i] = s->offset[i] / law->share[i - s->first[side]];
        s->slope[i] = k / law->share[i - s->first[side]];
        stiffness += slip->weight * k;
        s->base += slip->weight * s->offset[i];
      }
    }
    slip->start = slip->s;
    if (slip->share > 0.0) {
      s->any = 1;
      slip->q = 1.0 / curve(s, side, s->v);
      slip->ds = law->attraction * (slip->share * s->sigma - slip->s * slip->q);
    }
  }
  Linear *l = &s->lin;
  *l = (Linear){p->inertia, damping, stiffness, 0.5 * damping / p->inertia, stiffness / p->inertia, 0.0, 0.0};
  l->discriminant = l->square - l->decay * l->decay;
  l->frequency = sqrt(fabs(l->discriminant));
}

static double trigger(const State *s, double theta, double v) {
  double g = s->any ? -10.0 * s->sigma * v : -1e9, direction = v >= 0.0 ? 1.0 : -1.0;
  for (int side = 0; side < s->sides; side++) {
    const Contact *law = contact(s, side);
    double top = -1e9;
    for (int i = s->first[side]; i < s->first[side + 1]; i++)
      if (!s->slips[i]) {
        double load = direction * (s->load[i] + s->slope[i] * theta);
        if (load > top) top = load;
      }
    double limit = top > law->fc ? curve(s, side, v) : law->fc;
    if (top - limit > g) g = top - limit;
  }
  return g;
}

static void change_modes(State *s) {
  for (int side = 0; side < s->sides; side++) {
    const Contact *law = contact(s, side);
    double decay = exp(-s->slip[side].exponent);
    for (int i = s->first[side]; i < s->first[side + 1]; i++) {
      int j = i - s->first[side];
      if (s->slips[i])
        s->force[i] = decay * s->force[i]
                      + law->share[j] / s->slip[side].share * (s->slip[side].s_end - decay * s->slip[side].start);
      else
        s->force[i] = s->offset[i] + law->stiffness[j] * s->theta;
    }
  }
  if (s->any && s->sigma * s->v <= 1e-9 * fabs(s->v)) {
    for (int i = 0; i < s->first[2]; i++) s->slips[i] = 0;
  } else {
    double direction = s->v >= 0.0 ? 1.0 : -1.0;
    for (int side = 0; side < s->sides; side++) {
      const Contact *law = contact(s, side);
      double level = curve(s, side, s->v);
      for (int i = s->first[side]; i < s->first[side + 1]; i++)
        if (!s->slips[i] && direction * s->force[i] >= law->share[i - s->first[side]] * level - 1e-10) {
          s->slips[i] = 1;
          s->sigma = direction;
        }
    }
  }
  arrange(s);
}

/* ---- one stretch ---- */

enum { MOST_ROUNDS = 3, FEW_ROUNDS = 2 };

static void advance_slip(State *s, int side, double h, double v_mid, double v_end) {
  Slip *p = &s->slip[side];
  double c = contact(s, side)->attraction, goal = c * p->share * s->sigma;
  p->q_mid = 1.0 / curve(s, side, v_mid);
  p->q_end = 1.0 / curve(s, side, v_end);
  double right_mid = p->s + h * (5.0 / 24.0 * p->ds + 7.0 / 24.0 * goal);
  double right_end = p->s + h / 6.0 * (p->ds + 5.0 * goal);
  double m11 = 1.0 + h * c * p->q_mid / 3.0, m12 = -h * c * p->q_end / 24.0;
  double m21 = 2.0 * h * c * p->q_mid / 3.0, m22 = 1.0 + h * c * p->q_end / 6.0;
  p->s_end = (m11 * right_end - m21 * right_mid) / (m11 * m22 - m12 * m21);
  p->ds_end = goal - c * p->q_end * p->s_end;
}

/* Moves over h; returns how many rounds the corrector took, or more than MOST_ROUNDS. */
static int correct(State *s, Stretch *p, Command next, Matrix half, double h, double tol) {
  Matrix full = twice(half);
  double per_h = 1.0 / h, slope = (next.r - s->command.r) * per_h;
  double r2 = (3.0 * slope - 2.0 * s->command.dr - next.dr) * per_h;
  double r3 = (s->command.dr + next.dr - 2.0 * slope) * per_h * per_h;
  double p0 = s->command.r - s->base, p1 = s->command.dr, p2 = r2, p3 = r3;
  for (int side = 0; side < s->sides; side++) {
    p0 -= s->slip[side].weight * s->slip[side].s;
    p1 -= s->slip[side].weight * s->slip[side].ds;
  }
  p->h = h;
  for (int round = 0;; round++) {
    double theta = p->theta_end, v = p->v_end;
    p->c = particular(&s->lin, p0, p1, p2, p3);
    p->free_position = s->theta - p->c.c0;
    p->free_velocity = s->v - p->c.c1;
    move(p, half, 0.5 * h, &p->theta_mid, &p->v_mid);
    move(p, full, h, &p->theta_end, &p->v_end);
    if (!s->any) return 0;
    if (round && fabs(p->theta_end - theta) < 0.1 * tol && 1e-3 * fabs(p->v_end - v) < 0.1 * tol) return round;
    if (round == MOST_ROUNDS) return MOST_ROUNDS + 1;
    p2 = r2;
    p3 = r3;
    for (int side = 0; side < s->sides; side++) {
      Slip *q = &s->slip[side];
      if (q->share > 0.0) {
        advance_slip(s, side, h, p->v_mid, p->v_end);
        double m = (q->s_end - q->s) * per_h;
        p2 -= q->weight * (3.0 * m - 2.0 * q->ds - q->ds_end) * per_h;
        p3 -= q->weight * (q->ds + q->ds_end - 2.0 * m) * per_h * per_h;
      }
    }
  }
}

static double locate(const State *s, const Stretch *p, double low, double high, double g_low, double g_high, double tol) {
  int last = 0;
  for (int turn = 0; turn < 60; turn++) {
    double x = (low * g_high - high * g_low) / (g_high - g_low), theta, v;
    if (turn > 10 || !(x > low && x < high)) x = 0.5 * (low + high);
    move(p, flow(&s->lin, x), x, &theta, &v);
    double g = trigger(s, theta, v);
    if (g >= 0.0) {
      high = x, g_high = g;
      if (last == 1) g_low *= 0.5;
      last = 1;
    } else {
      low = x, g_low = g;
      if (last == -1) g_high *= 0.5;
      last = -1;
    }
    if (high - low < 1e-3 * tol || (g >= 0.0 && g < 50.0 * tol)) break;
  }
  return high;
}

/* Time of the first event in the stretch, or -1. */
static double find(const State *s, const Stretch *p, double tol) {
  double left = 0.0, theta = s->theta, v = s->v, g_left = -1e-3;
  for (int node = 1; node <= 2; node++) {
    double right = 0.5 * node * p->h, theta1 = node == 1 ? p->theta_mid : p->theta_end;
    double v1 = node == 1 ? p->v_mid : p->v_end, g = trigger(s, theta1, v1);
    if (s->any) { /* a reversal that dips through zero and back */
      double a0 = s->sigma * acceleration(&s->lin, p, left, theta, v);
      double a1 = s->sigma * acceleration(&s->lin, p, right, theta1, v1);
      if (a0 < 0.0 && a1 > 0.0 && s->sigma * v1 > 0.0 && s->sigma * v1 < -a0 * p->h) {
        double x = left + (right - left) * a0 / (a0 - a1), theta_x, v_x;
        move(p, flow(&s->lin, x), x, &theta_x, &v_x);
        if (s->sigma * v_x <= 0.0)
          return locate(s, p, left, x, fmin(g_left, -1e-15), fmax(trigger(s, theta_x, v_x), 1e-15), tol);
      }
    }
    if (g >= 0.0) return locate(s, p, left, right, fmin(g_left, -1e-15), fmax(g, 1e-15), tol);
    left = right, theta = theta1, v = v1, g_left = g;
  }
  return -1.0;
}

/* ---- the loop ---- */

static double amplitude_of(const State *s, const Stretch *p) {
  double u = p->free_velocity / s->lin.frequency;
  return s->lin.discriminant > 0.0 ? sqrt(p->free_position * p->free_position + u * u) : 0.0;
}

static Matrix half_of(State *s, int level, double h) {
  if (!(s->known >> level & 1)) {
    s->halves[level] = flow(&s->lin, 0.5 * h);
    s->known |= 1u << level;
  }
  return s->halves[level];
}

/* Takes one step of at most `left`; returns the rounds it took. */
static int step(State *s, Stretch *p, Command *next, double longest, double left, double tol, int *level) {
  for (;; ++*level) {
    double h = ldexp(longest, -*level);
    int cut = h > left - 1e-9;
    if (cut) h = left;
    *next = command_after(s->loop, s->t, s->command.z, h);
    int rounds = correct(s, p, *next, cut ? flow(&s->lin, 0.5 * h) : half_of(s, *level, h), h, tol);
    int rings = amplitude_of(s, p) > 2.0 * tol && s->lin.frequency * h > 3.2;
    if ((rounds <= MOST_ROUNDS && !rings) || h < 1e-6 || *level == DEEPEST - 1) return rounds;
  }
}

/* Position at x: on the exact flow where the free motion shows, else on the cubics through the nodes. */
static double position_at(const State *s, const Stretch *p, int shows, double x) {
  if (shows) {
    double theta, v;
    move(p, flow(&s->lin, x), x, &theta, &v);
    return theta;
  }
  double half = 0.5 * p->h;
  if (x > half) return hermite(p->theta_mid, p->v_mid, p->theta_end, p->v_end, half, x - half);
  return hermite(s->theta, s->v, p->theta_mid, p->v_mid, half, x);
}

/* Stands at x in the stretch, or at its end. */
static void advance(State *s, const Stretch *p, Command next, double x, int event) {
  for (int side = 0; side < s->sides; side++) {
    Slip *q = &s->slip[side];
    if (q->share > 0.0) {
      double f = x / p->h, bend = 2.0 * (q->q + q->q_end) - 4.0 * q->q_mid, slope = q->q_end - q->q - bend;
      q->exponent += contact(s, side)->attraction * x * (q->q + f * (0.5 * slope + f * bend / 3.0));
      if (event) q->s_end = hermite(q->s, q->ds, q->s_end, q->ds_end, p->h, x);
      else q->s = q->s_end, q->ds = q->ds_end, q->q = q->q_end;
    }
  }
  s->theta = p->theta_end;
  s->v = p->v_end;
  if (event) move(p, flow(&s->lin, x), x, &s->theta, &s->v);
  s->command = event ? command_after(s->loop, s->t, s->command.z, x) : next;
  s->t += x;
}

/* Writes the position at 0, spacing, 2 spacing, ... (n values); returns the number of events. */
int baseline(const Loop *p, double duration, double tol, double longest, double spacing, int n, double *out) {
  State s = {.loop = p, .sides = p->compensation == GMS_FEEDBACK ? 2 : 1, .sigma = 1.0};
  Stretch stretch = {0};
  s.first[1] = (int)p->plant.count;
  s.first[2] = s.first[1] + (s.sides == 2 ? (int)p->model.count : 0);
  s.slip[0] = (Slip){.weight = 1.0, .per_vs = 1.0 / p->plant.vs};
  s.slip[1] = (Slip){.weight = -1.0, .per_vs = 1.0 / p->model.vs};
  s.command = command_after(p, 0.0, 0.0, 0.0);
  arrange(&s);
  int row = 0, events = 0, after_event = (int)ceil(log2(longest / 2.5e-4)), level = after_event;
  double half_period = M_PI / p->omega, edge = half_period;
  while (s.t < duration - 1e-12) {
    double end = p->compensation == LUGRE_FEEDFORWARD && edge < duration ? edge : duration;
    Command next;
    int rounds = step(&s, &stretch, &next, longest, end - s.t, tol, &level);
    double x = find(&s, &stretch, tol), h = x >= 0.0 ? x : stretch.h, amplitude = amplitude_of(&s, &stretch);
    int rings = s.lin.discriminant > 0.0 && amplitude > 0.2 * tol && s.lin.frequency * stretch.h > 1.0;
    int shows = rings || (s.lin.discriminant < 0.0 && s.lin.frequency * stretch.h > 0.15);
    for (; row < n && row * spacing <= s.t + h + 1e-12; row++)
      out[row] = position_at(&s, &stretch, shows, row * spacing - s.t);
    advance(&s, &stretch, next, h, x >= 0.0);
    if (s.t >= edge - 1e-12) edge += half_period;
    if (x >= 0.0) {
      events++;
      change_modes(&s);
      if (level < after_event) level = after_event;
    } else if (rounds <= FEW_ROUNDS && level > 0 && h >= 0.999 * ldexp(longest, -level)
               && !(amplitude > 2.0 * tol && 2.0 * s.lin.frequency * h > 3.2)) {
      level--;
    }
  }
  for (; row < n; row++) out[row] = s.theta;
  return events;
}
