/* Latencies in whole microseconds, 64 buckets per power of two: every figure read back is within 1.6 %. */
#ifndef POSECAST_HISTOGRAM_H
#define POSECAST_HISTOGRAM_H
#include <stdint.h>

#define SUB_BITS 6
#define BUCKETS ((64 - SUB_BITS) << SUB_BITS)

struct histogram {
    uint64_t count[BUCKETS];
    uint64_t total, sum_us, max_us;
};

static unsigned bucket_of(uint64_t us) {
    if (us < (1u << SUB_BITS)) return (unsigned)us;
    unsigned power = 63u - (unsigned)__builtin_clzll(us);
    unsigned shift = power - SUB_BITS;
    return ((shift + 1) << SUB_BITS) + (unsigned)((us >> shift) & ((1u << SUB_BITS) - 1));
}

static double lower_edge_us(unsigned bucket) {
    unsigned row = bucket >> SUB_BITS, column = bucket & ((1u << SUB_BITS) - 1);
    if (row == 0) return column;
    return (double)(((uint64_t)1 << SUB_BITS) + column) * (double)((uint64_t)1 << (row - 1));
}

static void histogram_add(struct histogram *h, uint64_t us) {
    h->count[bucket_of(us)]++;
    h->total++;
    h->sum_us += us;
    if (us > h->max_us) h->max_us = us;
}

/* The value below which `share` (0…1) of the entries lie, in ms; 0 when empty. */
static double histogram_ms(const struct histogram *h, double share) {
    uint64_t wanted = (uint64_t)(share * (double)h->total), seen = 0;
    for (unsigned i = 0; i < BUCKETS; i++) {
        seen += h->count[i];
        if (seen > wanted) return lower_edge_us(i) / 1000.0;
    }
    return (double)h->max_us / 1000.0;
}
#endif
