/* The exact flow of J x'' + D x' + K x = p(t) with a cubic p, and cubics: see baseline.c.
 *
 * SPDX-License-Identifier: BSD-3-Clause
 */
#ifndef BASELINE_FLOW_H
#define BASELINE_FLOW_H

#include <math.h>

typedef struct { double a, b, c, d; } Matrix;            /* flow of (position, velocity) */
typedef struct { double c0, c1, c2, c3; } Cubic;
typedef struct { double inertia, damping, stiffness, decay, square, discriminant, frequency; } Linear;
typedef struct { double position, velocity; } Motion;

static inline Linear linear(double inertia, double damping, double stiffness) {
  Linear l = {inertia, damping, stiffness, 0.5 * damping / inertia, stiffness / inertia, 0.0, 0.0};
  l.discriminant = l.square - l.decay * l.decay;
  l.frequency = sqrt(fabs(l.discriminant));
  return l;
}

/* Rate at which unstable motion grows, 1/s. */
static inline double growth(const Linear *l) { return l->discriminant < 0.0 ? l->frequency - l->decay : 0.0; }

static inline Matrix flow(const Linear *l, double x) {
  double e = 1.0, c, s;
  if (l->discriminant > 0.0) {
    double si;
    e = exp(-l->decay * x);
    sincos(l->frequency * x, &si, &c);
    s = si / l->frequency;
  } else {
    double slow = exp((l->frequency - l->decay) * x), fast = exp(-(l->frequency + l->decay) * x);
    c = 0.5 * (slow + fast);
    s = l->frequency * x > 1e-7 ? 0.5 * (slow - fast) / l->frequency : x * slow;
  }
  return (Matrix){e * (c + l->decay * s), e * s, -e * l->square * s, e * (c - l->decay * s)};
}

static inline Matrix twice(Matrix m) {
  double trace = m.a + m.d;
  return (Matrix){m.a * m.a + m.b * m.c, m.b * trace, m.c * trace, m.d * m.d + m.b * m.c};
}

static inline Motion times(Matrix m, Motion y) {
  return (Motion){m.a * y.position + m.b * y.velocity, m.c * y.position + m.d * y.velocity};
}

static inline Cubic particular(const Linear *l, double p0, double p1, double p2, double p3) {
  double inverse = 1.0 / l->stiffness;
  Cubic c;
  c.c3 = p3 * inverse;
  c.c2 = (p2 - 3.0 * l->damping * c.c3) * inverse;
  c.c1 = (p1 - 2.0 * l->damping * c.c2 - 6.0 * l->inertia * c.c3) * inverse;
  c.c0 = (p0 - l->damping * c.c1 - 2.0 * l->inertia * c.c2) * inverse;
  return c;
}

static inline Motion on_cubic(const Cubic *c, double x) {
  return (Motion){c->c0 + x * (c->c1 + x * (c->c2 + x * c->c3)), c->c1 + x * (2.0 * c->c2 + x * 3.0 * c->c3)};
}

static inline Motion moved(const Cubic *c, Matrix m, double x, Motion released) {
  Motion y = on_cubic(c, x), z = times(m, released);
  return (Motion){y.position + z.position, y.velocity + z.velocity};
}

static inline double acceleration(const Linear *l, const Cubic *c, double x, Motion y) {
  Motion z = on_cubic(c, x);
  return 2.0 * c->c2 + 6.0 * c->c3 * x - l->square * (y.position - z.position)
         - 2.0 * l->decay * (y.velocity - z.velocity);
}

static inline double hermite(double y0, double d0, double y1, double d1, double h, double x) {
  double s = x / h, r = 1.0 - s;
  return r * r * (1.0 + 2.0 * s) * y0 + s * s * (3.0 - 2.0 * s) * y1 + s * r * h * (r * d0 - s * d1);
}

/* Quadratic and cubic coefficients of `hermite`. */
static inline void upper(double y0, double d0, double y1, double d1, double per_h, double *u2, double *u3) {
  double slope = (y1 - y0) * per_h;
  *u2 = (3.0 * slope - 2.0 * d0 - d1) * per_h;
  *u3 = (d0 + d1 - 2.0 * slope) * per_h * per_h;
}

#endif
