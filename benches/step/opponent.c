/* One step of a chain by the Gui family (lambda = 4), for one core, written for chains alone: what a general program is
 * measured against. Called by opponent.rs:
 *
 *     opponent N STEPS LAW        prints: median and least time of a step in microseconds, x of the first mass
 *
 * LAW: 0 none, 1 linear, 2 equation 42, 3 biviscous, 4 bilinear, 5 Bouc-Wen with exponent 1, 6 those five in turn.
 *
 * The chain is cut into 16 segments that are solved side by side, one per vector lane. Row j of all segments stands
 * together in memory, for the whole run: nothing is ever turned. Forces and the forward sweep are one loop, backward
 * sweep and the predictor another. Each segment is solved as if its neighbours stood still; what its two ends do to the
 * rows next to them is added afterwards, as far as it reaches. N that 16 does not divide is rounded down (5000 to 4992).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { LANES = 16 };
static const double M = 150, K = 2.5e5, C = 10, DT = 0.02, LAMBDA = 4, TURN = 6.283185307179586;
static const double LIN_K = 1e4, LIN_C = 50;
static const double ROOT_K = 2e4, ROOT_H = 1;
static const double VIS_C = 180, VIS_Y = 90, VIS_V = 1.0 / 3.0;
static const double YIELD_K = 5e4, YIELD_F = 500, YIELD_B = 0.05;
static const double BW_BETA = 0.6, BW_GAMMA = 0.4;

typedef double Lane[LANES] __attribute__((aligned(128)));

static void *room(size_t rows, size_t size) {
  void *all = NULL;
  if (posix_memalign(&all, 128, (rows + 2) * size)) exit(1);
  return memset(all, 0, (rows + 2) * size);
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

/* Laws at a mass. `s` and `z` are what they remember: slider or zeta, and where the last step ended. */
static inline double linear(double x, double v) { return LIN_K * x + LIN_C * v; }
static inline double root(double x) { return ROOT_K * x * (1 + ROOT_H * sqrt(fabs(x))); }
static inline double viscous(double v) {
  double u = fmax(fmin(v, VIS_V), -VIS_V);
  return VIS_C * u + VIS_Y * (v - u);
}
static inline double yields(double x, double *s) {
  double reach = YIELD_F / YIELD_K, e = x - *s;
  double held = fmax(fmin(e, reach), -reach);
  *s = x - held;
  return YIELD_B * YIELD_K * x + (1 - YIELD_B) * YIELD_K * held;
}
static inline double bouc_wen(double x, double *s, double *z) {
  double d = x - *s, way = d < 0 ? -1 : 1, tau = fabs(d) * (YIELD_K / YIELD_F);
  double y = way * *z, less = BW_BETA - BW_GAMMA, more = BW_BETA + BW_GAMMA;
  if (y < 0) { /* y' = 1 + less |y| up to zero */
    double zero = less == 0 ? -y : log1p(-less * y) / less;
    if (zero > tau) {
      y = less == 0 ? y + tau : (1 - (1 - less * y) * exp(-less * tau)) / less;
      tau = 0;
    } else {
      y = 0;
      tau -= zero;
    }
  }
  if (tau > 0) y = (1 - (1 - more * y) * exp(-more * tau)) / more;
  *s = x;
  *z = way * y;
  return YIELD_B * YIELD_K * x + (1 - YIELD_B) * YIELD_F * *z;
}
static inline double law(int which, size_t mass, double x, double v, double *s, double *z) {
  switch (which == 6 ? (int)(mass % 5) + 1 : which) {
    case 1: return linear(x, v);
    case 2: return root(x);
    case 3: return viscous(v);
    case 4: return yields(x, s);
    case 5: return bouc_wen(x, s, z);
    default: return 0;
  }
}
static void references(int which, size_t mass, double *k, double *c) {
  static const double ks[6] = {0, 1e4, 2e4, 0, 5e4, 5e4}, cs[6] = {0, 50, 0, 180, 0, 0};
  int w = which == 6 ? (int)(mass % 5) + 1 : which;
  *k = ks[w];
  *c = cs[w];
}

typedef struct {
  size_t rows, reach; /* rows of a segment; rows that an end reaches */
  Lane *x, *v, *y, *l, *d, *s, *z, *from_left, *from_right;
  double ends[2 * LANES][2 * LANES]; /* inverse of the system of all segment ends */
} Chain;

static void invert(double a[2 * LANES][2 * LANES]) {
  enum { N = 2 * LANES };
  double b[N][N] = {{0}};
  for (int i = 0; i < N; i++) b[i][i] = 1;
  for (int p = 0; p < N; p++) {
    int best = p;
    for (int i = p; i < N; i++)
      if (fabs(a[i][p]) > fabs(a[best][p])) best = i;
    for (int j = 0; j < N; j++) {
      double t = a[p][j]; a[p][j] = a[best][j]; a[best][j] = t;
      t = b[p][j]; b[p][j] = b[best][j]; b[best][j] = t;
    }
    double scale = 1 / a[p][p];
    for (int j = 0; j < N; j++) { a[p][j] *= scale; b[p][j] *= scale; }
    for (int i = 0; i < N; i++) {
      double f = a[i][p];
      if (i == p || f == 0) continue;
      for (int j = 0; j < N; j++) { a[i][j] -= f * a[p][j]; b[i][j] -= f * b[p][j]; }
    }
  }
  memcpy(a, b, sizeof b);
}

static Chain made(size_t n, int which) {
  size_t rows = n / LANES;
  Chain q = {.rows = rows};
  Lane **all[] = {&q.x, &q.v, &q.y, &q.l, &q.d, &q.s, &q.z, &q.from_left, &q.from_right};
  for (size_t i = 0; i < sizeof all / sizeof *all; i++) *all[i] = room(rows, sizeof(Lane));
  double link = DT / 2 * C + DT * DT / LAMBDA * K, *w = room(rows, sizeof(double));
  n = rows * LANES;
  for (int s = 0; s < LANES; s++) {
    double pivot = 0;
    for (size_t j = 0; j < rows; j++) {
      size_t mass = (size_t)s * rows + j;
      double k, c;
      references(which, mass, &k, &c);
      double own = M + DT / 2 * c + DT * DT / LAMBDA * k + (mass + 1 < n ? 2 : 1) * link;
      q.l[j][s] = j ? -link / pivot : 0;
      pivot = own + (j ? q.l[j][s] * link : 0);
      q.d[j][s] = 1 / pivot;
    }
    for (int right = 0; right < 2; right++) { /* what a unit at the neighbour does to the rows here */
      if (right ? s + 1 == LANES : s == 0) continue;
      memset(w, 0, rows * sizeof *w);
      w[right ? rows - 1 : 0] = -link;
      for (size_t j = 1; j < rows; j++) w[j] -= q.l[j][s] * w[j - 1];
      for (size_t j = rows; j-- > 0;) w[j] = w[j] * q.d[j][s] - (j + 1 < rows ? q.l[j + 1][s] * w[j + 1] : 0);
      for (size_t j = 0; j < rows; j++) {
        (right ? q.from_right : q.from_left)[j][s] = w[j];
        size_t far = right ? rows - j : j + 1;
        if (fabs(w[j]) > 1e-18 && far > q.reach) q.reach = far;
      }
    }
  }
  for (int s = 0; s < LANES; s++) {
    q.ends[2 * s][2 * s] = q.ends[2 * s + 1][2 * s + 1] = 1;
    for (int end = 0; end < 2; end++) {
      size_t j = end ? rows - 1 : 0;
      if (s > 0) q.ends[2 * s + end][2 * s - 1] += q.from_left[j][s];
      if (s + 1 < LANES) q.ends[2 * s + end][2 * s + 2] += q.from_right[j][s];
    }
  }
  invert(q.ends);
  free(w);
  return q;
}

/* Down: forces and the forward sweep. One copy per law, which the compiler is to know. */
static inline __attribute__((always_inline)) void down(size_t rows, const double *restrict x, const double *restrict v,
    double *restrict y, const double *restrict l, double *restrict memory, double *restrict zeta, double load,
    const int which) {
  double above[LANES], after[LANES], last[LANES] = {0}; /* link forces, and y of the row above */
  const double *xe = x + (rows - 1) * LANES, *ve = v + (rows - 1) * LANES;
  for (int s = 0; s < LANES; s++) {
    double xl = s ? xe[s - 1] : 0, vl = s ? ve[s - 1] : 0;
    above[s] = K * (x[s] - xl) + C * (v[s] - vl);
  }
  for (int s = 0; s < LANES; s++) after[s] = s + 1 < LANES ? above[s + 1] : 0;
  above[0] -= load;
  size_t j = 0;
  for (; j + 1 < rows; j++) {
    const double *xj = x + j * LANES, *vj = v + j * LANES, *lj = l + j * LANES;
    double *yj = y + j * LANES, *mj = memory + j * LANES, *zj = zeta + j * LANES;
    for (int s = 0; s < LANES; s++) {
      double below = K * (xj[LANES + s] - xj[s]) + C * (vj[LANES + s] - vj[s]);
      double own = law(which, which == 6 ? (size_t)s * rows + j : 0, xj[s], vj[s], mj + s, zj + s);
      double r = below - above[s] - own;
      above[s] = below;
      last[s] = r - lj[s] * last[s];
      yj[s] = last[s];
    }
  }
  for (int s = 0; s < LANES; s++) { /* the last row's link ends in the next segment */
    size_t at = j * LANES + (size_t)s;
    double own = law(which, which == 6 ? (size_t)s * rows + j : 0, x[at], v[at], memory + at, zeta + at);
    y[at] = after[s] - above[s] - own - l[at] * last[s];
  }
}

/* Up: the backward sweep and the predictor; w at the last row of each segment, then at the first. */
static void up(size_t rows, double *restrict x, double *restrict v, const double *restrict y, const double *restrict l,
    const double *restrict d, double *restrict at_last, double *restrict w) {
  size_t end = (rows - 1) * LANES;
  for (int s = 0; s < LANES; s++) {
    at_last[s] = w[s] = y[end + s] * d[end + s];
    double next = v[end + s] + DT * w[s];
    v[end + s] = next;
    x[end + s] += DT * next;
  }
  for (size_t j = rows - 1; j-- > 0;) {
    double *xj = x + j * LANES, *vj = v + j * LANES;
    const double *yj = y + j * LANES, *dj = d + j * LANES, *lj = l + (j + 1) * LANES;
    for (int s = 0; s < LANES; s++) {
      w[s] = yj[s] * dj[s] - lj[s] * w[s];
      double next = vj[s] + DT * w[s];
      vj[s] = next;
      xj[s] += DT * next;
    }
  }
}

static void step(Chain *q, double load, int which) {
  size_t rows = q->rows;
  double *x = *q->x, *v = *q->v, *y = *q->y, *l = *q->l;
#define OF(n) case n: down(rows, x, v, y, l, *q->s, *q->z, load, n); break;
  switch (which) { OF(0) OF(1) OF(2) OF(3) OF(4) OF(5) OF(6) }
  double w[LANES], at_last[LANES], ends[2 * LANES], known[2 * LANES];
  up(rows, x, v, y, l, *q->d, at_last, w);
  for (int s = 0; s < LANES; s++) ends[2 * s + 1] = at_last[s];
  for (int s = 0; s < LANES; s++) ends[2 * s] = w[s];
  for (int i = 0; i < 2 * LANES; i++) {
    known[i] = 0;
    for (int j = 0; j < 2 * LANES; j++) known[i] += q->ends[i][j] * ends[j];
  }
  size_t reach = q->reach < rows ? q->reach : rows;
  for (int side = 0; side < 2; side++) {
    Lane *restrict of = side ? q->from_right : q->from_left;
    double unit[LANES];
    for (int s = 0; s < LANES; s++)
      unit[s] = side ? (s + 1 < LANES ? known[2 * s + 2] : 0) : (s ? known[2 * s - 1] : 0);
    for (size_t k = 0; k < reach; k++) {
      size_t row = side ? rows - 1 - k : k;
      for (int s = 0; s < LANES; s++) {
        double more = -of[row][s] * unit[s];
        q->v[row][s] += DT * more;
        q->x[row][s] += DT * DT * more;
      }
    }
  }
}

static int by_size(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

int main(int count, char **given) {
  if (count < 4) return 2;
  size_t n = strtoul(given[1], NULL, 10), steps = strtoul(given[2], NULL, 10);
  int which = atoi(given[3]);
  Chain q = made(n, which);
  double *times = room(steps, sizeof(double));
  for (size_t i = 0; i < steps; i++) {
    double at = TURN * (double)i * DT, load = K * 0.1 * sin(at) + C * 0.1 * TURN * cos(at);
    double start = now();
    step(&q, load, which);
    times[i] = now() - start;
  }
  qsort(times, steps, sizeof *times, by_size);
  printf("%.4f %.4f %.15e\n", times[steps / 2], times[0], q.x[0][0]);
  return 0;
}
