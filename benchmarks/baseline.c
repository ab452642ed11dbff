/* The exact integrator in C: what the compiled Python kernel is measured against.
 *
 * J v' = T_m - T_f on a sinusoid from rest or a filtered step, PD or PID control, a GMS contact (thesis eqs. 2.16 to
 * 2.18), and one of no compensation, a feedforward torque from a table, feedback of Coulomb, Stribeck, LuGre or GMS
 * friction: compiled for each (MODEL, INTEGRAL, TABLE), as one would write a program for one loop. Between events the
 * motion is a cubic (forced) plus a 2x2 matrix exponential (free); slipping forces are advanced by Lobatto's rule of
 * fourth order and coupled by a corrector; break-aways and reversals are located on the exact flow. Steps are the
 * longest one halved some times: by an estimate of their error (CONTROL), or only as long as the corrector converges
 * quickly, which is cheaper where the longest step is given with the answer in sight.
 *
 * SPDX-License-Identifier: BSD-3-Clause
 */
#include "baseline_step.h"

/* ---- modes ---- */

static void gather(State *s, int side, int first) {
  const Law *law = &s->loop->law[side];
  Slip *slip = &s->slip[side];
  slip->share = slip->s = slip->exponent = slip->ds = slip->spring = slip->offset = 0.0;
  for (int j = 0; j < s->count[side]; j++) {
    int i = first + j;
    if (s->slips[i]) {
      slip->share += law->share[j];
      slip->s += s->force[i];
    } else {
      s->offset[i] = s->force[i] - law->stiffness[j] * s->theta;
      s->load[i] = s->offset[i] / law->share[j];
      s->slope[i] = law->stiffness[j] / law->share[j];
      slip->spring += law->stiffness[j];
      slip->offset += s->offset[i];
    }
  }
  slip->start = slip->s;
}

static void arrange(State *s) {
  const Loop *p = s->loop;
  double level[2];
  s->even_stiffness = p->kp, s->even_damping = p->kd, s->even_base = s->added = s->narrow = 0.0;
  s->watched = MODEL == COULOMB || MODEL == LUGRE || (MODEL == STRIBECK && !s->inside);
  s->corrected = INTEGRAL || MODEL == LUGRE || (MODEL == STRIBECK && !s->inside);
  s->known = 0;
  if (MODEL == LUGRE) {
    Slip *q = &s->slip[1];
    q->s += q->spring * s->theta + q->offset;
    q->spring = q->offset = 0.0;
  }
  for (int side = 0; side < SIDES; side++) {
    Slip *slip = &s->slip[side];
    s->even_damping += WEIGHT[side] * p->law[side].viscous;
    if (side >= GMS_SIDES) break;
    gather(s, side, side ? s->count[0] : 0);
    s->even_stiffness += WEIGHT[side] * slip->spring;
    s->even_base += WEIGHT[side] * slip->offset;
    if (slip->share > 0.0) s->watched = s->corrected = 1;
  }
  if (s->watched && s->corrected) {
    curves(s, s->v, level);
    for (int side = 0; side < GMS_SIDES; side++) {
      Slip *slip = &s->slip[side];
      slip->q = 1.0 / level[side];
      if (slip->share > 0.0) slip->ds = p->law[side].attraction * (slip->share * s->sigma - slip->s * slip->q);
    }
  }
  if (MODEL == COULOMB) s->slip[1].s = s->sigma * p->law[1].fc;
  if (MODEL == STRIBECK) {
    s->slip[1].s = s->slip[1].damping = 0.0;
    if (s->inside) {
      /* Over the moment that a crossing takes, the added spring moves nothing. */
      s->even_damping += WEIGHT[1] * (p->law[1].steepness - p->law[1].viscous);
      s->added = 2e-4 * p->law[1].steepness * p->law[1].steepness / p->inertia;
      s->corrected = 1;
    } else {
      s->narrow = p->law[1].layer;
    }
  }
  int sticks = 0;
  for (int i = 0; i < s->count[0] + s->count[1]; i++) sticks |= !s->slips[i];
  s->calm = !sticks && !INTEGRAL && !BENT && s->even_stiffness > 0.0 && s->even_damping > 0.0;
  s->base = s->even_base;
  s->lin = linear(p->inertia, s->even_damping, s->even_stiffness + s->added);
}

/* Takes the flow anew for a step of about h. */
static void bend(State *s, double h) {
  double stiffness = s->even_stiffness, damping = s->even_damping;
  if (MODEL == LUGRE) {
    double g = bend_lugre(s, h, stiffness);
    stiffness -= g;
    damping -= s->loop->law[1].lag * g;
    s->base = s->even_base + g * s->theta;
  }
  if (MODEL == STRIBECK) {
    damping -= bend_stribeck(s);
    double floor = 0.01 * fabs(damping) / h;
    s->added = fabs(stiffness) < floor ? 2.0 * floor : 0.0;
    stiffness += s->added;
  }
  s->lin = linear(s->loop->inertia, damping, stiffness);
  s->known = 0;
}

static double trigger(const State *s, Motion y) {
  double v = y.velocity, direction = v >= 0.0 ? 1.0 : -1.0, level[2] = {0.0, 0.0}, g = -1e9;
  if (s->watched) g = -10.0 * (s->sigma * v - s->narrow + 1e-12);
  if (MODEL == STRIBECK && s->inside) g = fmax(g, 10.0 * (fabs(v) - s->loop->law[1].layer));
  for (int side = 0, i = 0; side < GMS_SIDES; side++) {
    const Law *law = &s->loop->law[side];
    double top = -1e9;
    for (int last = i + s->count[side]; i < last; i++)
      if (!s->slips[i]) {
        double load = direction * (s->load[i] + s->slope[i] * y.position);
        if (load > top) top = load;
      }
    double limit = law->fc;
    if (top > limit) {
      if (level[side] == 0.0) curves(s, v, level);
      limit = level[side];
    }
    if (top - limit > g) g = top - limit;
  }
  return g;
}

static void break_away(State *s, double v, double direction) {
  double level[2];
  curves(s, v, level);
  for (int side = 0, i = 0; side < GMS_SIDES; side++)
    for (int j = 0; j < s->count[side]; j++, i++)
      if (!s->slips[i] && direction * s->force[i] >= s->loop->law[side].share[j] * level[side] - 1e-10) {
        s->slips[i] = 1;
        s->sigma = direction;
      }
}

static void settle_forces(State *s) {
  for (int side = 0, i = 0; side < GMS_SIDES; side++) {
    const Law *law = &s->loop->law[side];
    const Slip *p = &s->slip[side];
    double decay = p->share > 0.0 ? exp(-p->exponent) : 1.0;
    for (int j = 0; j < s->count[side]; j++, i++)
      s->force[i] = s->slips[i] ? decay * s->force[i] + law->share[j] / p->share * (p->s - decay * p->start)
                                : s->offset[i] + law->stiffness[j] * s->theta;
  }
}

static void change_modes(State *s) {
  settle_forces(s);
  double edge = s->loop->law[1].layer;
  if (MODEL == STRIBECK && s->inside && fabs(s->v) >= (1.0 - 1e-6) * edge) {
    s->inside = 0;
    s->sigma = s->v > 0.0 ? 1.0 : -1.0;
  } else if (MODEL == STRIBECK && !s->inside && s->sigma * s->v <= (1.0 + 1e-6) * edge) {
    s->inside = 1;
  }
  if (s->watched && s->sigma * s->v <= 1e-9 * fabs(s->v)) {
    for (int i = 0; i < s->count[0] + s->count[1]; i++) s->slips[i] = 0;
    if (s->sigma * s->v > 0.0) s->v = 0.0;
    if (MODEL == COULOMB) {
      /* Feedback of sign(v) repels from rest: the applied torque says where to. */
      double torque = s->command.r + s->loop->ki * s->integral - s->loop->kp * s->theta;
      for (int i = 0; i < s->count[0]; i++) torque -= s->force[i];
      s->sigma = torque > 0.0 ? 1.0 : -1.0;
      if (s->sigma * s->v < 0.0) s->v = 0.0;
    } else {
      s->sigma = -s->sigma;
    }
    break_away(s, s->sigma * fmax(s->sigma * s->v, 1e-12), s->sigma);
  } else {
    break_away(s, s->v, s->v >= 0.0 ? 1.0 : -1.0);
  }
  arrange(s);
}

/* ---- events ---- */

static double locate(const State *s, const Stretch *p, double low, double high, double g_low, double g_high, double tol) {
  int last = 0;
  for (int turn = 0; turn < 60; turn++) {
    double x = (low * g_high - high * g_low) / (g_high - g_low);
    if (turn > 10 || !(x > low && x < high)) x = 0.5 * (low + high);
    double g = trigger(s, moved(&p->c, flow(&s->lin, x), x, p->released));
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
  Motion y = {s->theta, s->v};
  double left = 0.0, g_left = -1e-3;
  for (int node = 1; node <= 2; node++) {
    double right = 0.5 * node * p->h;
    Motion z = node == 1 ? p->mid : p->end;
    if (s->watched && s->sigma * z.velocity > s->narrow) { /* a reversal that dips through zero and back */
      double a0 = s->sigma * acceleration(&s->lin, &p->c, left, y), a1 = s->sigma * acceleration(&s->lin, &p->c, right, z);
      if (a0 < 0.0 && a1 > 0.0 && s->sigma * z.velocity - s->narrow < -a0 * p->h) {
        double x = left + (right - left) * a0 / (a0 - a1);
        Motion dip = moved(&p->c, flow(&s->lin, x), x, p->released);
        if (s->sigma * dip.velocity <= s->narrow)
          return locate(s, p, left, x, fmin(g_left, -1e-15), fmax(trigger(s, dip), 1e-15), tol);
      }
    }
    double g = trigger(s, z);
    if (g >= 0.0) return locate(s, p, left, right, fmin(g_left, -1e-15), fmax(g, 1e-15), tol);
    left = right, y = z, g_left = g;
  }
  return -1.0;
}

/* ---- the loop ---- */

static double amplitude_of(const State *s, const Stretch *p) {
  double u = p->released.velocity / s->lin.frequency;
  return s->lin.discriminant > 0.0 ? sqrt(p->released.position * p->released.position + u * u) : 0.0;
}

static Matrix half_of(State *s, int level, double h) {
  if (!(s->known >> level & 1)) {
    s->halves[level] = flow(&s->lin, 0.5 * h);
    s->known |= 1u << level;
  }
  return s->halves[level];
}

/* The command in the middle of the next h; where it has lain on the cubic, the next few are taken from it. */
static Command middle_of(State *s, Command next, double h, double tol) {
  Command c = s->command;
  double middle = 0.5 * (c.r + next.r) + 0.125 * h * (c.dr - next.dr);
  if (!CONTROL && !INTEGRAL) return next;
  if (s->unseen > 0 && h <= s->seen) {
    s->unseen--;
    return (Command){.r = middle};
  }
  Command out = command_at(s, s->t + 0.5 * h);
  int smooth = !INTEGRAL && !TABLE && fabs(out.r - middle) * h * h < 0.1 * tol * s->loop->inertia;
  s->unseen = smooth ? 4 : 0;
  s->seen = h;
  return out;
}

static int rings(const State *s, const Stretch *p, double h, double tol) {
  return s->lin.frequency * h > 3.2 && amplitude_of(s, p) > 2.0 * tol;
}

/* Takes one step of at most `left`; returns 0 where none converges. */
static int step(State *s, Stretch *p, Command *next, double longest, double left, double tol, int *level) {
  double unstable = growth(&s->lin);
  for (;; ++*level) {
    double h = ldexp(longest, -*level);
    while (unstable * fmin(h, left) > 8.0 && *level < DEEPEST - 1) h = ldexp(longest, -++*level);
    int cut = h > left - 1e-9;
    if (cut) h = left;
    *next = command_at(s, s->t + h);
    Command middle = middle_of(s, *next, h, tol);
    correct(s, p, middle, *next, cut ? flow(&s->lin, 0.5 * h) : half_of(s, *level, h), h, tol);
    if (p->error <= tol && !rings(s, p, h, tol)) return 1;
    if (*level == DEEPEST - 1) return p->error < NOT_CONVERGED;
  }
}

/* The level of the next step after one that was not cut short. */
static int next_level(const State *s, const Stretch *p, int level, double tol) {
  double h = p->h, error = p->error;
  for (int turn = 0; turn < (CONTROL ? 3 : 1); turn++, level--) {
    h *= 2.0;
    if (level == 0 || error >= 0.03 * tol || p->rounds > FEW_ROUNDS || rings(s, p, h, tol)) return level;
    error *= 32.0;
  }
  return level;
}

/* Writes position and velocity of the rows up to x in the stretch. */
static int write_rows(State *s, const Stretch *p, double spacing, int row, int n, double x, double tol, double *out) {
  int last = (int)((s->t + x + 1e-12) / spacing) + 1;
  if (last > n) last = n;
  if (row >= last) return row;
  const Cubic c = p->c;
  const double t = s->t;
  if (s->lin.discriminant > 0.0 && amplitude_of(s, p) <= 0.01 * tol) {
    for (int i = row; i < last; i++) {
      Motion y = on_cubic(&c, i * spacing - t);
      out[2 * i] = y.position, out[2 * i + 1] = y.velocity;
    }
    return last;
  }
  Motion released = times(flow(&s->lin, row * spacing - t), p->released);
  if (!(s->known >> BETWEEN & 1) && row + 1 < last) {
    s->between = flow(&s->lin, spacing);
    s->known |= 1u << BETWEEN;
  }
  for (int i = row; i < last; i++) {
    Motion y = on_cubic(&c, i * spacing - t);
    out[2 * i] = y.position + released.position, out[2 * i + 1] = y.velocity + released.velocity;
    released = times(s->between, released);
  }
  return last;
}

/* Stands at x in the stretch, or at its end. */
static void advance(State *s, const Stretch *p, Command next, double x, int event) {
  for (int side = 0; side < GMS_SIDES; side++) {
    Slip *q = &s->slip[side];
    if (q->share > 0.0) {
      double f = x / p->h, bend = 2.0 * (q->q + q->q_end) - 4.0 * q->q_mid, slope = q->q_end - q->q - bend;
      q->exponent += s->loop->law[side].attraction * x * (q->q + f * (0.5 * slope + f * bend / 3.0));
      if (event) q->s = hermite(q->s, q->ds, q->s_end, q->ds_end, p->h, x);
      else q->s = q->s_end, q->ds = q->ds_end, q->q = q->q_end;
    }
  }
  if (MODEL == LUGRE) {
    Slip *q = &s->slip[1];
    q->s = event ? hermite(q->s, q->ds, q->s_end, q->ds_end, p->h, x) : q->s_end;
  }
  if (INTEGRAL) {
    double e0 = s->command.goal - s->theta, e1 = next.goal - p->end.position;
    s->integral = event ? hermite(s->integral, e0, p->integral_end, e1, p->h, x) : p->integral_end;
  }
  Motion y = event ? moved(&p->c, flow(&s->lin, x), x, p->released) : p->end;
  s->theta = y.position, s->v = y.velocity;
  s->t += x;
  s->command = event ? command_at(s, s->t) : next;
}

/* Writes position and velocity at 0, spacing, 2 spacing, ... (n of them) up to the last of the breaks, onto which it
 * steps; returns the number of events, or -1 where no step converges. */
static int run(const Loop *p, const double *cells, int count, const double *breaks, double tol, double longest,
               double spacing, int n, double *out) {
  State s = {.loop = p, .cells = cells, .last_cell = count - 1, .high = breaks[0] - 1e-12, .low = 1e-12};
  Stretch stretch = {0};
  const Law *one = &p->law[0], *other = &p->law[1];
  s.alike = one->fs == other->fs && one->fc == other->fc && one->vs == other->vs;
  s.count[0] = (int)one->count, s.count[1] = MODEL == GMS ? (int)other->count : 0;
  s.command = command_at(&s, 0.0);
  s.sigma = command_at(&s, 1e-9).r >= 0.0 ? 1.0 : -1.0;
  s.inside = MODEL == STRIBECK;
  arrange(&s);
  int row = 0, events = 0, after_event = (int)fmax(0.0, ceil(log2(longest / 2.5e-4))), level = after_event;
  const double duration = (n - 1) * spacing;
  while (s.t < duration - 1e-12) {
    double left = *breaks - s.t;
    Command next;
    if (BENT && !(MODEL == STRIBECK && s.inside)) bend(&s, fmin(left, ldexp(longest, -level)));
    if (!step(&s, &stretch, &next, longest, left, tol, &level)) return -1;
    double x = find(&s, &stretch, tol), h = x >= 0.0 ? x : stretch.h;
    row = write_rows(&s, &stretch, spacing, row, n, h, tol, out);
    advance(&s, &stretch, next, h, x >= 0.0);
    if (x >= 0.0) {
      int fast = growth(&s.lin) * 2.5e-4 > 8.0;
      events++;
      change_modes(&s);
      if (level < after_event || fast) level = after_event;
    } else if (h >= 0.999 * ldexp(longest, -level)) {
      level = next_level(&s, &stretch, level, tol);
    }
    if (h >= left - 1e-12) {
      s.t = *breaks++;
      if (s.t >= duration - 1e-12) break;
      s.low = s.t + 1e-12, s.high = *breaks - 1e-12, s.unseen = 0;
      s.command = command_at(&s, s.t);
    }
  }
  for (; row < n; row++) out[2 * row] = s.theta, out[2 * row + 1] = s.v;
  return events;
}

/* The same so many times: what a call costs from Python does not count. */
int baseline(int times, const Loop *p, const double *cells, int count, const double *breaks, double tol, double longest,
             double spacing, int n, double *out) {
  int events = 0;
  for (int i = 0; i < times; i++) events = run(p, cells, count, breaks, tol, longest, spacing, n, out);
  return events;
}
