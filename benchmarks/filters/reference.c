/* The particle filter of wsn_env/filters/kernels.py in C, step by step the same arithmetic. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define LANES 16
#define BLOCK 8
#define REACH 16
typedef float lanes __attribute__((vector_size(4 * LANES)));

struct model {
    double period_s, q, noise, level, slope, floor, resample_below;
    int64_t strength, members, process, resampling;
};

struct stream {
    uint64_t start, inner;
};

static const uint64_t GOLDEN = 0x9E3779B97F4A7C15u, MIX_1 = 0xBF58476D1CE4E5B9u, MIX_2 = 0x94D049BB133111EBu;

/* --- elementary functions, bits --- */

static inline float from_bits(int32_t bits)
{
    float x;
    memcpy(&x, &bits, 4);
    return x;
}

static inline int32_t to_bits(float x)
{
    int32_t bits;
    memcpy(&bits, &x, 4);
    return bits;
}

static inline int32_t greater(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

static inline float log32(float x)
{
    int32_t bits = to_bits(x), exponent = (bits - 0x3F3504F3) >> 23;
    float f = from_bits(bits - exponent * (1 << 23)) - 1.0f, p = 7.0376836292e-2f;
    p = p * f - 1.1514610310e-1f;
    p = p * f + 1.1676998740e-1f;
    p = p * f - 1.2420140846e-1f;
    p = p * f + 1.4249322787e-1f;
    p = p * f - 1.6668057665e-1f;
    p = p * f + 2.0000714765e-1f;
    p = p * f - 2.4999993993e-1f;
    p = p * f + 3.3333331174e-1f;
    float z = f * f;
    return (float)exponent * 0.6931471805599453f + (f + (p * f * z - 0.5f * z));
}

static inline float exp32(float x)
{
    float t = x * 1.44269504089f;
    t = t > -126.0f ? t : -126.0f;
    float n = floorf(t + 0.5f), f = t - n, p = 1.535336188319500e-4f;
    p = p * f + 1.339887440266574e-3f;
    p = p * f + 9.618437357674640e-3f;
    p = p * f + 5.550332471162809e-2f;
    p = p * f + 2.402264791363012e-1f;
    p = p * f + 6.931472028550421e-1f;
    p = p * f + 1.0f;
    return p * from_bits(((int32_t)n + 127) << 23);
}

static inline uint64_t mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * MIX_1;
    z = (z ^ (z >> 27)) * MIX_2;
    return z ^ (z >> 31);
}

static inline struct stream stream_of(uint64_t key, uint64_t period, uint64_t purpose)
{
    uint64_t a = mix(mix(key + GOLDEN) ^ (period * 0xD1342543DE82EF95u + purpose * GOLDEN));
    return (struct stream){a, mix(a ^ 0x5851F42D4C957F2Du)};
}

static inline uint64_t bits_of(struct stream s, uint64_t index)
{
    uint64_t z = s.start + index * GOLDEN;
    z = (z ^ (z >> 30)) * MIX_1 + s.inner;
    z = (z ^ (z >> 27)) * MIX_2;
    return z ^ (z >> 31);
}

static inline void normal_pair32(uint64_t h, float *first, float *second)
{
    int32_t low = (int32_t)(h & 0xFFFFFF), high = (int32_t)(h >> 32);
    float u = ((float)low + 0.5f) * 5.9604644775390625e-08f;
    float t = ((float)(high & 0xFFFFFF) + 0.5f) * 9.3623573e-08f - 0.78539816339f, t2 = t * t;
    float s = t + t * t2 * (-1.6666654611e-1f + t2 * (8.3321608736e-3f + t2 * -1.9515295891e-4f));
    float c = 1.0f - 0.5f * t2
        + t2 * t2 * (4.166664568298827e-02f + t2 * (-1.388731625493765e-3f + t2 * 2.443315711809948e-5f));
    float radius = sqrtf(-log32(u));
    int32_t sign = INT32_MIN;
    *first = from_bits(to_bits(radius * (c - s)) ^ ((int32_t)((uint32_t)high << 7) & sign));
    *second = from_bits(to_bits(radius * (c + s)) ^ ((int32_t)((uint32_t)high << 6) & sign));
}

/* --- the steps of the filter --- */

static void predict(struct stream s, int64_t n, float *restrict x, const struct model *m)
{
    float *restrict px = x, *restrict vx = x + n, *restrict py = x + 2 * n, *restrict vy = x + 3 * n;
    float t = (float)m->period_s, h = (float)(0.5 * m->period_s * m->period_s * m->q), g = (float)(m->period_s * m->q);
    for (int64_t i = 0; i < n; i++) {
        float ax, ay;
        normal_pair32(bits_of(s, (uint64_t)i), &ax, &ay);
        px[i] += t * vx[i] + h * ax;
        vx[i] += g * ax;
        py[i] += t * vy[i] + h * ay;
        vy[i] += g * ay;
    }
}

static void weigh(int64_t n, const float *restrict px, const float *restrict py, float *restrict log_weights,
                  const double *sensor, const double *value, const struct model *m)
{
    float half_precision = (float)(0.5 / fmax(m->noise * m->noise, 1e-20));
    if (!m->strength) {
        float zx = (float)value[0], zy = (float)value[1];
        for (int64_t i = 0; i < n; i++) {
            float dx = px[i] - zx, dy = py[i] - zy;
            log_weights[i] -= half_precision * (dx * dx + dy * dy);
        }
        return;
    }
    float sx = (float)sensor[0], sy = (float)sensor[1], z = (float)value[0];
    float level = (float)m->level, slope = (float)m->slope, floor = (float)fmax(m->floor, 1e-12);
    for (int64_t i = 0; i < n; i++) {
        float dx = px[i] - sx, dy = py[i] - sy, squared = dx * dx + dy * dy;
        float r = (z - level) + slope * log32(squared > floor ? squared : floor);
        log_weights[i] -= half_precision * (r * r);
    }
}

static void normalise(int64_t n, float *restrict log_weights, float *restrict weights)
{
    int32_t least = INT32_MAX; /* log weights are <= 0: their bits, read as integers, order as they do */
    for (int64_t i = 0; i < n; i++) {
        int32_t bits = to_bits(-log_weights[i]);
        least = bits < least ? bits : least;
    }
    float best = -from_bits(least);
    for (int64_t i = 0; i < n; i++) {
        log_weights[i] -= best;
        weights[i] = exp32(log_weights[i]);
    }
}

static inline void gather(lanes w, lanes d0, lanes d1, lanes d2, lanes d3, lanes *restrict sums)
{
    lanes e0 = w * d0, e1 = w * d1, e2 = w * d2, e3 = w * d3;
    sums[0] += w;
    sums[1] += w * w;
    sums[2] += e0;
    sums[3] += e1;
    sums[4] += e2;
    sums[5] += e3;
    sums[6] += e0 * d0;
    sums[7] += e0 * d1;
    sums[8] += e0 * d2;
    sums[9] += e0 * d3;
    sums[10] += e1 * d1;
    sums[11] += e1 * d2;
    sums[12] += e1 * d3;
    sums[13] += e2 * d2;
    sums[14] += e2 * d3;
    sums[15] += e3 * d3;
}

static inline lanes load(const float *from, int64_t count)
{
    lanes x = {0};
    memcpy(&x, from, 4 * (size_t)count);
    return x;
}

/* mean holds the reference point of the sums and becomes the mean; returns the sum of the weights. */
static double moments(int64_t n, const float *x, const float *weights, double *mean, double *cov, double *n_eff)
{
    lanes sums[16] = {0};
    float r[4];
    int64_t whole = n / LANES * LANES;
    for (int a = 0; a < 4; a++)
        r[a] = (float)mean[a];
    for (int64_t i = 0; i < whole; i += LANES)
        gather(load(weights + i, LANES), load(x + i, LANES) - r[0], load(x + n + i, LANES) - r[1],
               load(x + 2 * n + i, LANES) - r[2], load(x + 3 * n + i, LANES) - r[3], sums);
    for (int64_t i = whole; i < n; i++) /* the rest in lane 0: the others get +0 */
        gather(load(weights + i, 1), load(x + i, 1) - r[0], load(x + n + i, 1) - r[1], load(x + 2 * n + i, 1) - r[2],
               load(x + 3 * n + i, 1) - r[3], sums);
    double s[16] = {0}, shift[4];
    for (int row = 0; row < 16; row++)
        for (int k = 0; k < LANES; k++)
            s[row] += (double)sums[row][k];
    double total = s[0];
    for (int a = 0; a < 4; a++)
        shift[a] = s[2 + a] / total;
    for (int a = 0, entry = 6; a < 4; a++) {
        mean[a] = (double)r[a] + shift[a];
        for (int b = a; b < 4; b++, entry++)
            cov[4 * a + b] = cov[4 * b + a] = s[entry] / total - shift[a] * shift[b];
    }
    for (int a = 0; a < 4; a++)
        cov[5 * a] = cov[5 * a] > 0.0 ? cov[5 * a] : 0.0;
    for (int a = 0; a < 4; a++)
        for (int b = a + 1; b < 4; b++) {
            double limit = sqrt(cov[5 * a] * cov[5 * b]);
            cov[4 * a + b] = cov[4 * b + a] = fmin(fmax(cov[4 * a + b], -limit), limit);
        }
    *n_eff = total * total / s[1];
    return total;
}

/* Every slot's ancestor, from REACH on: the particle after the last one that ends before the slot. Of the particles that
   end at one place the last to be written stays; what is left is a running maximum. */
static void inherit(double u, int64_t n, const float *restrict weights, double total, int32_t *restrict ended,
                    int32_t *restrict recent, int32_t *restrict ancestors)
{
    memset(ended, 0, 4 * (size_t)(n + 4));
    double scale = (double)n / total, base = 1.0 - u;
    int32_t last = (int32_t)n;
    int64_t whole = (n - 1) / BLOCK * BLOCK;
    for (int64_t o = 0; o < whole; o += BLOCK) { /* sums apart, so that blocks need not wait for each other */
        double cumulated = 0.0;
        for (int64_t k = 0; k < BLOCK; k++) {
            cumulated += (double)weights[o + k] * scale;
            int32_t end = (int32_t)(base + cumulated);
            ended[3 + (end < last ? end : last)] = (int32_t)(o + k + 1);
        }
        base += cumulated;
    }
    for (int64_t i = whole; i < n - 1; i++) {
        base += (double)weights[i] * scale;
        int32_t end = (int32_t)base;
        ended[3 + (end < last ? end : last)] = (int32_t)(i + 1);
    }
    for (int64_t k = 0; k < n; k++)
        recent[k + 12] = greater(greater(ended[k], ended[k + 1]), greater(ended[k + 2], ended[k + 3]));
    for (int64_t k = 0; k < n; k++) {
        int32_t here = greater(greater(recent[k], recent[k + 4]), greater(recent[k + 8], recent[k + 12]));
        ancestors[k + REACH] = greater(here, ancestors[k]);
    }
}

struct state {
    float x, vx, y, vy;
};

static void draw(int64_t n, float *restrict x, const int32_t *restrict ancestors, struct state *restrict states,
                 struct state *restrict drawn)
{
    float *restrict px = x, *restrict vx = x + n, *restrict py = x + 2 * n, *restrict vy = x + 3 * n;
    for (int64_t i = 0; i < n; i++)
        states[i] = (struct state){px[i], vx[i], py[i], vy[i]};
    for (int64_t k = 0; k < n; k++)
        drawn[k] = states[(uint32_t)ancestors[k]];
    for (int64_t k = 0; k < n; k++) {
        px[k] = drawn[k].x;
        vx[k] = drawn[k].vx;
        py[k] = drawn[k].y;
        vy[k] = drawn[k].vy;
    }
}

/* One period, counted from 1, of every row. Shapes: sensors, values (rows, members, 2); particles (rows, 4, n);
   log_weights (rows, n); mean (rows, 4): in, the reference of the sums; cov (rows, 4, 4); n_eff (rows);
   scratch: weights (n), slots (3, n + REACH) that start with zeros, states (2, n). */
void filter_rows(int64_t rows, int64_t n, const struct model *m, int64_t period, const uint64_t *keys,
                 const double *sensors, const double *values, float *particles, float *log_weights, double *mean,
                 double *cov, double *n_eff, float *weights, int32_t *slots, struct state *states)
{
    int32_t *ended = slots, *recent = ended + n + REACH, *ancestors = recent + n + REACH;
    for (int64_t b = 0; b < rows; b++) {
        float *x = particles + 4 * n * b, *lw = log_weights + n * b;
        predict(stream_of(keys[b], (uint64_t)period, (uint64_t)m->process), n, x, m);
        for (int64_t j = b * m->members; j < (b + 1) * m->members; j++)
            weigh(n, x, x + 2 * n, lw, sensors + 2 * j, values + 2 * j, m);
        normalise(n, lw, weights);
        double total = moments(n, x, weights, mean + 4 * b, cov + 16 * b, n_eff + b);
        if (n_eff[b] < m->resample_below * (double)n) {
            struct stream s = stream_of(keys[b], (uint64_t)period, (uint64_t)m->resampling);
            inherit((double)(bits_of(s, 0) >> 11) * 0x1p-53, n, weights, total, ended, recent, ancestors);
            draw(n, x, ancestors + REACH, states, states + n);
            memset(lw, 0, 4 * (size_t)n);
        }
    }
}
