/* The header of wire format 1, as far as a seq needs it, and the newest bases that were seen (by anyone).
 *
 * A KEY carries its seq. Every other frame names its base by id (FNV-1a-32 of the base's whole message) and gives the
 * distance to it. Each base is hashed once for all viewers: a seq that is already known is not hashed again. */
#ifndef POSECAST_WIRE_HEADER_H
#define POSECAST_WIRE_HEADER_H
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define BASES 64u

struct base {
    uint32_t seq, id;
    uint8_t known;
};
static struct base bases[BASES];

struct header {
    uint32_t seq, base_id; /* base_id: of the frame this one is coded against; 0 for a KEY */
    uint32_t own_id;       /* of this frame when others may be coded against it, else 0 */
    uint8_t is_key;
};

static uint32_t fnv1a32(const uint8_t *bytes, size_t size) {
    uint32_t hash = 2166136261u;
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * 16777619u;
    return hash;
}

static uint32_t base_id(uint32_t seq, const uint8_t *bytes, size_t size) {
    struct base *slot = &bases[seq % BASES];
    if (!slot->known || slot->seq != seq) *slot = (struct base){seq, fnv1a32(bytes, size), 1};
    return slot->id;
}

/* 1 when the frame's seq could be told; 0: not this wire format, or its base was never seen. */
static int read_header(const uint8_t *bytes, size_t size, struct header *h) {
    if (size < 9 || bytes[0] >> 4 != 1) return 0;
    h->is_key = bytes[0] & 1;
    h->base_id = h->own_id = 0;
    if (h->is_key) {
        memcpy(&h->seq, bytes + 5, 4);
    } else {
        uint16_t distance;
        memcpy(&h->base_id, bytes + 1, 4);
        memcpy(&distance, bytes + 5, 2);
        unsigned i = 0;
        while (i < BASES && !(bases[i].known && bases[i].id == h->base_id)) i++;
        if (i == BASES) return 0;
        h->seq = bases[i].seq + distance;
    }
    if (bytes[0] & 3) h->own_id = base_id(h->seq, bytes, size);
    return 1;
}
#endif
