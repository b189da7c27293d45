// The floor for benchmarks/step.py: the same step by hand, float32 columns, everything fused block by block.
// Built by workload.py:  clang -O3 -march=native -ffast-math -fopenmp-simd -shared -fPIC limit.c -o limit.so -lm
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define BLOCK 512
#define INLINE static inline __attribute__((always_inline))
enum { BEACONS = 4, SUMS = 12 };

typedef struct { float *north, *east, *heading, *log_weight; } Set;
typedef struct {
    int count; uint32_t seed, tick; Set now, spare; int32_t *ancestor;
    float distance_sigma, turn_sigma, gain, offset, n[BEACONS], e[BEACONS]; double reference[3];
} Filter;

INLINE float real(uint32_t u) { float f; memcpy(&f, &u, 4); return f; }
INLINE uint32_t bits(float f) { uint32_t u; memcpy(&u, &f, 4); return u; }
INLINE int32_t nearest(float x) { return (int32_t)(bits(x + 12582912.0f) - 0x4B400000u); }
INLINE uint32_t hash(uint32_t x) {  // lowbias32, Chris Wellons
    x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; x *= 0x846ca68bu; return x ^ x >> 16;
}
INLINE float sine(float x) {
    float z = x * x;
    return x + x * z * (((2.6000545e-6f * z - 1.9806615e-4f) * z + 8.3330173e-3f) * z - 1.6666657e-1f);
}
INLINE float cosine(float x) {
    float z = x * x;
    return 1.0f + z * (((2.3194384e-5f * z - 1.3855927e-3f) * z + 4.1663989e-2f) * z - 4.9999932e-1f);
}
INLINE float logarithm2(uint32_t b) {
    int32_t e = (int32_t)(b - 0x3f400000u) >> 23;
    float m = real(b - ((uint32_t)e << 23)) - 1.0f, p = -0.1640529f;
    p = p * m + 0.2321853f; p = p * m - 0.2484958f; p = p * m + 0.2870306f; p = p * m - 0.3601675f;
    p = p * m + 0.4809189f; p = p * m - 0.7213540f; p = p * m + 1.4426948f;
    return (float)e + p * m;
}
INLINE float power2(float t) {  // 2^t for t <= 0
    t = t < -126.0f ? -126.0f : t;
    int32_t k = nearest(t);
    float f = t - (float)k, p = 1.3333558e-3f;
    p = p * f + 9.6181291e-3f; p = p * f + 5.5504109e-2f; p = p * f + 2.4022651e-1f;
    p = p * f + 6.9314718e-1f; p = p * f + 1.0f;
    return real(bits(p) + ((uint32_t)k << 23));
}

// One pair of normals per particle, motion, four ranges and the weighted sums of a block; its largest log weight.
static float block(const Filter *f, int first, int n, float distance, float turn, const float *z, float *sums) {
    float *restrict x = f->now.north + first, *restrict y = f->now.east + first;
    float *restrict h = f->now.heading + first, *restrict l = f->now.log_weight + first;
    float a[BLOCK], b[BLOCK], top = -1e30f;
    const uint32_t key = hash(f->seed ^ f->tick * 0x9E3779B9u), other = hash(key + 77u);
    #pragma omp simd
    for (int i = 0; i < n; i++) {
        uint32_t p = hash((uint32_t)(first + i) * 0x9E3779B9u ^ key), q = hash((uint32_t)(first + i) * 0x85EBCA6Bu + other);
        float r = sqrtf(-1.38629436f * logarithm2(bits(2.0f - real((p >> 9) | 0x3f800000u))));
        float angle = (float)(int32_t)(q & 0xFFFFFFFEu) * (1.57079633f / 2147483648.0f);
        a[i] = r * sine(angle);
        b[i] = real(bits(r * cosine(angle)) ^ (q << 31));
    }
    const float n0 = f->n[0], n1 = f->n[1], n2 = f->n[2], n3 = f->n[3], e0 = f->e[0], e1 = f->e[1], e2 = f->e[2], e3 = f->e[3];
    const float ds = f->distance_sigma, ts = f->turn_sigma, gain = f->gain, offset = f->offset;
    #pragma omp simd reduction(max : top)
    for (int i = 0; i < n; i++) {
        float d = distance + ds * a[i], t = turn + ts * b[i], middle = h[i] + 0.5f * t;
        int32_t k = nearest(middle * 0.318309886f);
        float r = middle - (float)k * 3.140625f - (float)k * 9.67653589793e-4f;
        uint32_t sign = (uint32_t)k << 31;
        float X = x[i] + d * real(bits(cosine(r)) ^ sign), Y = y[i] + d * real(bits(sine(r)) ^ sign);
        x[i] = X; y[i] = Y; h[i] += t;
        float q0 = sqrtf((X - n0) * (X - n0) + (Y - e0) * (Y - e0)) - z[0], q1 = sqrtf((X - n1) * (X - n1) + (Y - e1) * (Y - e1)) - z[1];
        float q2 = sqrtf((X - n2) * (X - n2) + (Y - e2) * (Y - e2)) - z[2], q3 = sqrtf((X - n3) * (X - n3) + (Y - e3) * (Y - e3)) - z[3];
        float log_weight = l[i] + offset - gain * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3);
        l[i] = log_weight; top = log_weight > top ? log_weight : top;
    }
    const float rx = (float)f->reference[0], ry = (float)f->reference[1], rh = (float)f->reference[2];
    float w0 = 0, w2 = 0, sx = 0, sy = 0, ss = 0, sc = 0, xx = 0, xy = 0, yy = 0, xh = 0, yh = 0, hh = 0;
    #pragma omp simd reduction(+ : w0, w2, sx, sy, ss, sc, xx, xy, yy, xh, yh, hh)
    for (int i = 0; i < n; i++) {
        float w = power2(l[i] - top), dx = x[i] - rx, dy = y[i] - ry, dh = h[i] - rh;
        dh -= 6.28318531f * (float)nearest(dh * 0.159154943f);
        float half = 0.5f * dh, s = sine(half), c = cosine(half), wx = w * dx, wy = w * dy;
        w0 += w; w2 += w * w; sx += wx; sy += wy; ss += w * 2.0f * s * c; sc += w * (1.0f - 2.0f * s * s);
        xx += wx * dx; xy += wx * dy; yy += wy * dy; xh += wx * dh; yh += wy * dh; hh += w * dh * dh;
    }
    float out[SUMS] = {w0, w2, sx, sy, ss, sc, xx, xy, yy, xh, yh, hh};
    memcpy(sums, out, sizeof out);
    return top;
}

static void resample(Filter *f, float top, double total, double uniform) {
    int count = f->count; int32_t *restrict ancestor = f->ancestor; float w[BLOCK];
    memset(ancestor, 0, 4 * ((size_t)count + 1));
    double cumulative = 0.0; int32_t end = 0;
    for (int i = 0; i < count; i += BLOCK) {
        int n = count - i < BLOCK ? count - i : BLOCK; float local = 0.0f;
        const float *restrict l = f->now.log_weight + i, scale = (float)(count / total);
        #pragma omp simd
        for (int j = 0; j < n; j++) w[j] = power2(l[j] - top) * scale;
        for (int j = 0; j < n; j++) {
            ancestor[end] = i + j; local += w[j];
            int32_t next = (int32_t)(cumulative + local + 1.0 - uniform);
            end = next > count ? count : next;
        }
        cumulative += local;
    }
    for (int32_t i = 0, latest = 0; i < count; i++) { latest = ancestor[i] > latest ? ancestor[i] : latest; ancestor[i] = latest; }
    for (int i = 0; i < count; i++) f->spare.north[i] = f->now.north[ancestor[i]];
    for (int i = 0; i < count; i++) f->spare.east[i] = f->now.east[ancestor[i]];
    for (int i = 0; i < count; i++) f->spare.heading[i] = f->now.heading[ancestor[i]];
    memset(f->spare.log_weight, 0, 4 * (size_t)count);
    Set old = f->now; f->now = f->spare; f->spare = old;
}

static Set columns(int count) {
    size_t size = ((size_t)count * 4 + 127) & ~(size_t)63;
    Set s = {aligned_alloc(64, size), aligned_alloc(64, size), aligned_alloc(64, size), aligned_alloc(64, size)};
    memset(s.log_weight, 0, size);
    return s;
}

Filter *make(int count, const float *start, const float *beacons, float distance_sigma, float turn_sigma, float sigma) {
    Filter *f = calloc(1, sizeof *f);
    f->count = count; f->seed = 1; f->now = columns(count); f->spare = columns(count);
    f->ancestor = malloc(4 * ((size_t)count + 1));
    memcpy(f->now.north, start, 4 * (size_t)count); memcpy(f->now.east, start + count, 4 * (size_t)count);
    memcpy(f->now.heading, start + 2 * (size_t)count, 4 * (size_t)count);
    for (int k = 0; k < BEACONS; k++) { f->n[k] = beacons[2 * k]; f->e[k] = beacons[2 * k + 1]; }
    f->distance_sigma = distance_sigma; f->turn_sigma = turn_sigma; f->gain = 0.72134752f / (sigma * sigma);
    f->reference[0] = f->reference[1] = 25.0;
    return f;
}

// One step; the mean into out, and the processor time it took, nanoseconds.
double step(Filter *f, float distance, float turn, const float *ranges, double *out) {
    struct timespec before, after; clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &before);
    f->tick++;
    double a[SUMS] = {0}, top = -1e30;
    for (int first = 0; first < f->count; first += BLOCK) {
        float s[SUMS]; int n = f->count - first < BLOCK ? f->count - first : BLOCK;
        double t = block(f, first, n, distance, turn, ranges, s), old = 1.0, new = 1.0;
        if (t > top) { old = exp2(top - t); top = t; } else new = exp2(t - top);
        for (int k = 0; k < SUMS; k++) a[k] = a[k] * (k == 1 ? old * old : old) + s[k] * (k == 1 ? new * new : new);
    }
    double x = a[2] / a[0], y = a[3] / a[0], h = atan2(a[4], a[5]); volatile double covariance[6];
    for (int k = 0; k < 6; k++) covariance[k] = a[6 + k] / a[0];
    (void)covariance;
    f->offset = (float)-top;
    if (a[0] * a[0] / a[1] < 0.5 * f->count) {
        resample(f, (float)top, a[0], (hash(f->tick) + 0.5) / 4294967296.0); f->offset = 0.0f;
    }
    f->reference[0] += x; f->reference[1] += y; f->reference[2] += h;
    out[0] = f->reference[0]; out[1] = f->reference[1];
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &after);
    return (after.tv_sec - before.tv_sec) * 1e9 + (after.tv_nsec - before.tv_nsec);
}
