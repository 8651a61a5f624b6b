/* When each seq was published: CLOCK_MONOTONIC ns in one shared file, slot seq % STAMP_SLOTS.
 *
 * The relay carries frames unread, so a time inside the payload would need a payload of the bench's own. Instead
 * the publisher notes the time here just before it hands the frame over, and the viewers look it up by the seq in the
 * frame's header. All servers, also those that make their own payload, are measured by this one clock.
 *
 * One slot more says whether all viewers are connected. Until then every server is fed once a second: otherwise those that
 * saturate would let nobody in any more. */
#ifndef POSECAST_STAMPS_H
#define POSECAST_STAMPS_H
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define STAMP_SLOTS 65536u
#define STAMP_FILE_SIZE ((STAMP_SLOTS + 1) * sizeof(uint64_t))
#define ALL_CONNECTED STAMP_SLOTS

static uint64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000ull + (uint64_t)t.tv_nsec;
}

/* The file must exist with its full size (the bench makes it). */
static uint64_t *open_stamps(const char *path) {
    int fd = open(path, O_RDWR);
    if (fd < 0) {
        fprintf(stderr, "stamps: cannot open %s\n", path);
        exit(2);
    }
    void *at = mmap(NULL, STAMP_FILE_SIZE, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (at == MAP_FAILED) {
        fprintf(stderr, "stamps: cannot map %s\n", path);
        exit(2);
    }
    return at;
}
#endif
