/* N viewers of the lane in one thread: they read a robot's segments by HTTP as the page does, and say what came, how old it
 * was, and how many bytes it took.
 *
 *   lane_viewers --port P --robot NAME --viewers N [--host 127.0.0.1] [--view public] [--join 4] [--sources 64] [--seconds 600]
 *
 * A viewer asks where the past ends (`/past?view=`), gets the newest segment, and then each next one 0.8 s before it is due
 * by what came before (the page's rule, spa/src/stream/lane/lane.ts): the last one's end, the shortest of the last three
 * durations, the least time from an end to the arrival of the last ten. Until a request was held, and after two segments in a row that were there already, it asks
 * at once, and after each third such segment where the past ends: there it begins where that is more than three segments further (a cache may have told an old end,
 * and what it told before is nothing new). 204 → again after Retry-Ms; 200 with JSON → the
 * segment that it names; anything else, and a connection that breaks → again after 0 to 2 s, then twice that … up to 32 s.
 * Each request is under way for 0 to 0.2 s more, drawn anew, as over a network. Connections are kept, and opened anew when their server has ended
 * them. All have come after --join seconds.
 *
 * Each line on standard input prints what was counted since the last one as a JSON object, with the line as `name`, and
 * begins anew; the end of standard input, or --seconds, prints the last one and ends. The exit status is then 0.
 * `least`: the fewest segments that any viewer got since the last line.
 *
 * `age`: from the moment at which the relay accepted a segment's first frame (unix ms, in its header, of this machine's
 * clock) until the last byte of it is here: as far is a viewer behind that plays steadily. A viewer's first segment has no
 * age: it is as old as it happens to be. `waited`: from asking to the last byte, of segments. Bytes are those of the socket,
 * headers included; `packets` and `records` are what they need at least: 1,448 bytes in a packet of Ethernet (TCP with timestamps),
 * 16,384 in a record of TLS, each answer by itself. */
#define _GNU_SOURCE
#include "histogram.h"
#include "loopback.h"
#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#define VIEWERS_MAX 20000
#define HEAD_MAX 2048u /* of an answer; a longer one is an error */
#define KEPT_MAX 512u  /* of a body: a segment's header as far as it is read here */
#define BODY_MAX (3u << 20)
#define SLOT_MS 5
#define SLOTS 16384u /* of SLOT_MS: 81 s, longer than any wait */
#define PATIENCE_S 30.0 /* for an answer */
#define AHEAD_MS 800
#define WAY_MS 200 /* at most */
#define RETRY_MS 1000
#define EMPTY_MS 3000
#define BACK_OFF_MS 2000 /* at most, the first time */
#define BACK_OFFS 4 /* times it doubles */
#define HELD_US 300000
#define LOOK_EVERY 3 /* segments in a row that were there already */
#define MISSED_MAX 3 /* of so many each is fetched */
#define SPANS 3
#define CLOSES 10
#define PACKET 1448u
#define RECORD 16384u

enum phase { RESTING, CONNECTING, ASKED };

struct viewer {
    int fd;
    enum phase phase;
    uint8_t found, told_not_yet; /* a request was held: so it is known when segments come */
    uint8_t knows, begun, used, errors; /* knows what to ask for; has a segment; the connection has answered; in a row */
    uint64_t take, run;
    uint32_t index, last_seq, run_known;
    uint32_t arrived; /* segments, in all */
    uint32_t ready; /* segments in a row that were there already */
    uint64_t told_take; /* what was told to be the newest at last */
    uint32_t told_index;
    int64_t spans_ms[SPANS], closes_ms[CLOSES]; /* of the newest ones: duration, and arrival less end */
    uint64_t asked_ns, slot;
    int64_t body_left;
    uint32_t head_size, kept_size, got, mine; /* mine: segments since the last report */
    int next; /* in its slot */
    uint8_t head[HEAD_MAX], kept[KEPT_MAX];
};

static struct {
    const char *host, *robot, *view;
    int port, viewers, sources;
    double seconds, join;
} o = {.host = "127.0.0.1", .view = "public", .sources = 64, .seconds = 600, .join = 4};

static struct viewer *viewers;
static int epoll, *slots;
static uint64_t turned, started; /* slots that are over; when it all began, ns */
static struct histogram age, waited;
static struct {
    uint64_t segments, first, frames, gaps, missed, repeats, not_yet, nexts, summaries, unreadable, lost, opened, silent;
    uint64_t sent, heads, bodies, packets, records, segment_heads, segment_bodies, asked;
} seen;
static uint32_t refused[600];

static uint64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000ull + (uint64_t)t.tv_nsec;
}

static uint64_t unix_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (uint64_t)t.tv_sec * 1000000ull + (uint64_t)t.tv_nsec / 1000;
}

static int64_t draw(int64_t below) {
    static uint64_t state = 88172645463325252ull;
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return (int64_t)(state % (uint64_t)below);
}

/* ---- when to ask ------------------------------------------------------------------- */

static void wait_ms(struct viewer *v, int64_t ms) {
    if (ms < 0) ms = 0;
    if (ms > (int64_t)(SLOTS - 2) * SLOT_MS) ms = (int64_t)(SLOTS - 2) * SLOT_MS;
    uint64_t slot = now_ns() / (SLOT_MS * 1000000ull) + 1 + (uint64_t)ms / SLOT_MS;
    if (slot <= turned) slot = turned + 1;
    v->phase = RESTING;
    v->next = slots[slot % SLOTS];
    slots[slot % SLOTS] = (int)(v - viewers);
}

static int64_t least_of(const int64_t *ms, uint32_t known, uint32_t most) {
    int64_t least = ms[0];
    for (uint32_t i = 1; i < known && i < most; i++)
        if (ms[i] < least) least = ms[i];
    return least;
}

static void back_off(struct viewer *v) {
    int64_t ms = (int64_t)BACK_OFF_MS << v->errors;
    if (v->errors < BACK_OFFS) v->errors++;
    wait_ms(v, draw(ms));
}

static void hang_up(struct viewer *v) {
    if (v->fd >= 0) close(v->fd);
    v->fd = -1;
    v->used = 0;
}

static void lose(struct viewer *v) {
    hang_up(v);
    seen.lost++;
    back_off(v);
}

/* ---- asking ------------------------------------------------------------------------- */

static void ask(struct viewer *v) {
    char text[600];
    int size = snprintf(text, sizeof text, "GET /api/v1/robots/%s/past", o.robot);
    if (v->knows) size += snprintf(text + size, sizeof text - (size_t)size, "/%s/%016" PRIx64 "/%u", o.view, v->take, v->index);
    else size += snprintf(text + size, sizeof text - (size_t)size, "?view=%s", o.view);
    size += snprintf(text + size, sizeof text - (size_t)size, " HTTP/1.1\r\nHost: %s:%d\r\n\r\n", o.host, o.port);
    v->phase = ASKED;
    v->asked_ns = now_ns();
    v->head_size = v->kept_size = v->got = 0;
    v->body_left = -1;
    seen.asked++;
    if (send(v->fd, text, (size_t)size, MSG_NOSIGNAL) != size) lose(v);
    else seen.sent += (uint64_t)size;
}

static void connect_anew(struct viewer *v) {
    v->fd = open_socket("lane_viewers");
    struct epoll_event e = {.events = EPOLLOUT, .data.ptr = v};
    epoll_ctl(epoll, EPOLL_CTL_ADD, v->fd, &e);
    v->phase = CONNECTING;
    v->asked_ns = now_ns();
    v->used = 0;
    seen.opened++;
    if (!begin_connect(v->fd, o.host, o.port, (int)(v - viewers) % o.sources)) lose(v);
}

static void go_on(struct viewer *v) {
    if (v->fd < 0) connect_anew(v);
    else ask(v);
}

/* ---- what came ---------------------------------------------------------------------- */

static uint64_t read_varint(const uint8_t **at, const uint8_t *end) {
    uint64_t value = 0;
    for (int shift = 0; *at < end && shift < 56; shift += 7) {
        uint8_t byte = *(*at)++;
        value |= (uint64_t)(byte & 127) << shift;
        if (!(byte & 128)) return value;
    }
    *at = end + 1;
    return 0;
}

static uint64_t read_u64(const uint8_t **at, const uint8_t *end) {
    uint64_t value = 0;
    if (end - *at < 8) *at = end + 1;
    else memcpy(&value, *at, 8), *at += 8;
    return value;
}

struct segment {
    uint64_t take, index, run, from_ms, lasted_ms, frames, first_seq, last_seq;
};

/* The front of a segment's header (SPEC §10). */
static int read_segment(const uint8_t *bytes, size_t size, struct segment *s) {
    const uint8_t *at = bytes + 9, *end = bytes + size;
    if (size < 13 || memcmp(bytes, "\x89PCS\x01", 5)) return 0;
    for (int text = 0; text < 2; text++) {
        uint64_t length = read_varint(&at, end);
        if (at > end || length > (uint64_t)(end - at)) return 0;
        at += length;
    }
    s->take = read_u64(&at, end);
    if (at > end) return 0;
    s->index = read_varint(&at, end);
    if (at > end) return 0;
    s->run = read_u64(&at, end);
    uint64_t *rest[] = {&s->from_ms, &s->lasted_ms, &s->frames, &s->first_seq, &s->last_seq};
    for (int i = 0; i < 5 && at <= end; i++) *rest[i] = read_varint(&at, end);
    return at <= end;
}

static void take_segment(struct viewer *v, size_t head, size_t body) {
    struct segment s;
    if (!read_segment(v->kept, v->kept_size, &s) || s.take != v->take || s.index != v->index) {
        seen.unreadable++;
        v->knows = 0;
        back_off(v);
        return;
    }
    uint64_t us = unix_us();
    seen.segments++;
    v->mine++;
    seen.frames += s.frames;
    seen.segment_heads += head;
    seen.segment_bodies += body;
    if (s.frames) {
        if (!v->begun) seen.first++;
        else if (us > s.from_ms * 1000) histogram_add(&age, us - s.from_ms * 1000);
        if (v->run_known && v->run == s.run) {
            int32_t step = (int32_t)((uint32_t)s.first_seq - v->last_seq);
            if (step <= 0) seen.repeats++;
            else if (step > 1) seen.gaps++, seen.missed += (uint64_t)step - 1;
        }
        v->run = s.run, v->run_known = 1, v->last_seq = (uint32_t)s.last_seq;
    }
    uint64_t took_us = (now_ns() - v->asked_ns) / 1000;
    histogram_add(&waited, took_us);
    v->begun = 1;
    int held = took_us > HELD_US || v->told_not_yet;
    v->found |= held;
    v->ready = held ? 0 : v->ready + 1;
    v->told_not_yet = 0;
    int64_t now_ms = (int64_t)(us / 1000), to_ms = (int64_t)(s.from_ms + s.lasted_ms);
    v->spans_ms[v->arrived % SPANS] = (int64_t)s.lasted_ms;
    v->closes_ms[v->arrived % CLOSES] = now_ms - to_ms;
    v->arrived++;
    v->index++;
    int64_t due_ms = to_ms + least_of(v->closes_ms, v->arrived, CLOSES) + least_of(v->spans_ms, v->arrived, SPANS) - AHEAD_MS;
    if (v->ready && v->ready % LOOK_EVERY == 0) v->knows = 0;
    wait_ms(v, (v->found && v->ready < 2 && due_ms > now_ms ? due_ms - now_ms : 0) + draw(WAY_MS));
}

/* Of `{"next":{"take":"…","index":n}}` or of a summary's `newest`. */
static void take_name(struct viewer *v) {
    char text[KEPT_MAX + 1], *at;
    unsigned index;
    uint64_t take;
    memcpy(text, v->kept, v->kept_size);
    text[v->kept_size] = 0;
    at = strstr(text, v->knows ? "\"next\":{" : "\"newest\":{");
    if (!at || sscanf(strchr(at, '{'), "{\"take\":\"%16" SCNx64 "\",\"index\":%u}", &take, &index) != 2) {
        seen.unreadable += v->knows; /* a summary: there is nothing yet */
        wait_ms(v, EMPTY_MS / 2 + draw(EMPTY_MS));
        return;
    }
    int same = v->knows && take == v->take && index == v->index;
    if (v->knows) seen.nexts++;
    else seen.summaries++;
    if (!v->knows) {
        int told_before = take == v->told_take && index == v->told_index;
        int64_t by = (int64_t)index + 1 - v->index; /* v->index is that of the one after the last */
        v->told_take = take, v->told_index = index;
        if (v->begun && (told_before || (take == v->take && by >= -1 && by <= MISSED_MAX))) take = v->take, index = v->index;
    }
    v->take = take, v->index = index, v->knows = 1;
    wait_ms(v, (same ? RETRY_MS : 0) + draw(WAY_MS));
}

static long find_number(const struct viewer *v, const char *name) { /* a header's; -1: it isn't there */
    const char *at = (const char *)v->head, *end = at + v->head_size;
    size_t length = strlen(name);
    while ((at = memmem(at, (size_t)(end - at), "\r\n", 2)) && (size_t)(end - at) > length + 3) {
        at += 2;
        if (!strncasecmp(at, name, length) && at[length] == ':') return atol(at + length + 1);
    }
    return -1;
}

static int status_of(const struct viewer *v) { return v->head_size > 12 ? atoi((const char *)v->head + 9) : 0; }

static void take_answer(struct viewer *v) {
    int status = status_of(v);
    size_t head = v->head_size, body = v->got - v->head_size;
    char end[] = "connection: close";
    int closes = 0;
    for (size_t i = 0; i + sizeof end - 1 <= head; i++) closes |= !strncasecmp((char *)v->head + i, end, sizeof end - 1);
    seen.heads += head, seen.bodies += body;
    seen.packets += (v->got + PACKET - 1) / PACKET, seen.records += (v->got + RECORD - 1) / RECORD;
    v->used = 1;
    if (closes) hang_up(v);
    if (status == 200 || status == 204) v->errors = 0;
    if (status == 204) {
        long ms = find_number(v, "retry-ms");
        seen.not_yet++, v->told_not_yet = 1, v->ready = 0;
        if (ms < RETRY_MS || ms > 60000) ms = RETRY_MS;
        wait_ms(v, ms + draw(WAY_MS));
    } else if (status == 200 && v->kept_size && v->kept[0] == '{') take_name(v);
    else if (status == 200) take_segment(v, head, body);
    else {
        refused[status > 0 && status < 600 ? status : 0]++;
        if (status == 404) v->knows = 0; /* gone: from where the past ends now */
        back_off(v);
    }
}

/* Takes bytes of the answer; 0 when the connection can't go on. */
static int take_bytes(struct viewer *v, const uint8_t *bytes, size_t size) {
    if (v->body_left < 0) {
        size_t before = v->head_size, room = HEAD_MAX - before, more = size < room ? size : room;
        memcpy(v->head + before, bytes, more);
        uint8_t *end = memmem(v->head, before + more, "\r\n\r\n", 4);
        if (!end) {
            v->head_size += (uint32_t)more, v->got += (uint32_t)more;
            return before + more < HEAD_MAX;
        }
        v->head_size = (uint32_t)(end - v->head) + 4;
        v->got = v->head_size;
        int status = status_of(v);
        long length = find_number(v, "content-length");
        if (length < 0 && status != 204 && status != 304) return 0;
        v->body_left = length < 0 ? 0 : length;
        if (v->body_left > BODY_MAX) return 0;
        bytes += v->head_size - before, size -= v->head_size - before;
    }
    if ((int64_t)size > v->body_left) return 0; /* more than was asked for */
    size_t keep = KEPT_MAX - v->kept_size < size ? KEPT_MAX - v->kept_size : size;
    memcpy(v->kept + v->kept_size, bytes, keep);
    v->kept_size += (uint32_t)keep, v->got += (uint32_t)size, v->body_left -= (int64_t)size;
    if (!v->body_left) take_answer(v);
    return 1;
}

static void read_from(struct viewer *v) {
    static uint8_t heard[65536];
    ssize_t n = recv(v->fd, heard, sizeof heard, MSG_DONTWAIT);
    if (n < 0 && errno == EAGAIN) return;
    if (v->phase != ASKED) { /* ended while nothing was asked for, as servers do */
        hang_up(v);
        return;
    }
    if (n > 0 && take_bytes(v, heard, (size_t)n)) return;
    int again = n <= 0 && v->used && !v->got; /* it ended just when it was asked: browsers ask once more */
    if (again) hang_up(v), connect_anew(v);
    else lose(v);
}

/* ---- the loop ----------------------------------------------------------------------- */

static void turn(void) {
    uint64_t slot = now_ns() / (SLOT_MS * 1000000ull);
    while (turned < slot) {
        int *first = &slots[++turned % SLOTS], at = *first;
        *first = -1;
        while (at >= 0) {
            struct viewer *v = &viewers[at];
            at = v->next;
            go_on(v);
        }
    }
}

static void drop_silent(void) {
    static uint64_t swept;
    uint64_t now = now_ns();
    if (now - swept < 1000000000ull) return;
    swept = now;
    for (int i = 0; i < o.viewers; i++)
        if (viewers[i].phase != RESTING && (double)(now - viewers[i].asked_ns) * 1e-9 > PATIENCE_S) seen.silent++, lose(&viewers[i]);
}

static double own_cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static void report(const char *name) {
    static uint64_t began;
    static double own;
    uint64_t now = now_ns();
    double wall = (double)(now - (began ? began : started)) * 1e-9;
    uint32_t least = UINT32_MAX;
    for (int i = 0; i < o.viewers; i++) {
        if (viewers[i].mine < least) least = viewers[i].mine;
        viewers[i].mine = 0;
    }
    printf("{\"name\":\"%s\",\"viewers\":%d,\"wall_s\":%.4f,\"least\":%u,\"segments\":%lu,\"first\":%lu,\"frames\":%lu,\"gaps\":%lu,\"missed\":%lu,"
           "\"repeats\":%lu,\"not_yet\":%lu,\"nexts\":%lu,\"summaries\":%lu,\"unreadable\":%lu,",
           name, o.viewers, wall, least, seen.segments, seen.first, seen.frames, seen.gaps, seen.missed, seen.repeats, seen.not_yet,
           seen.nexts, seen.summaries, seen.unreadable);
    printf("\"lost\":%lu,\"silent\":%lu,\"opened\":%lu,\"asked\":%lu,\"sent\":%lu,\"heads\":%lu,\"bodies\":%lu,\"packets\":%lu,"
           "\"records\":%lu,\"segment_heads\":%lu,\"segment_bodies\":%lu,\"refused\":{",
           seen.lost, seen.silent, seen.opened, seen.asked, seen.sent, seen.heads, seen.bodies, seen.packets, seen.records,
           seen.segment_heads, seen.segment_bodies);
    for (int i = 0, first = 1; i < 600; i++)
        if (refused[i]) printf("%s\"%d\":%u", first ? "" : ",", i, refused[i]), first = 0;
    struct histogram *of[] = {&age, &waited};
    const char *names[] = {"age_ms", "waited_ms"};
    printf("}");
    for (int i = 0; i < 2; i++)
        printf(",\"%s\":{\"p50\":%.1f,\"p95\":%.1f,\"p99\":%.1f,\"max\":%.1f}", names[i], histogram_ms(of[i], .5),
               histogram_ms(of[i], .95), histogram_ms(of[i], .99), (double)of[i]->max_us / 1000);
    printf(",\"generator_share\":%.3f}\n", wall > 0 ? (own_cpu_s() - own) / wall : 0);
    fflush(stdout);
    memset(&seen, 0, sizeof seen), memset(refused, 0, sizeof refused);
    memset(&age, 0, sizeof age), memset(&waited, 0, sizeof waited);
    began = now, own = own_cpu_s();
}

/* 0 at the end of standard input. */
static int hear_driver(void) {
    static char line[64];
    static size_t size;
    char heard[256];
    ssize_t n = read(0, heard, sizeof heard);
    for (ssize_t i = 0; i < n; i++) {
        if (heard[i] == '\n') line[size] = 0, report(line), size = 0;
        else if (size < sizeof line - 1 && isalnum((unsigned char)heard[i])) line[size++] = heard[i];
    }
    return n > 0;
}

static void read_options(int argc, char **argv) {
    for (int i = 1; i + 1 < argc; i += 2) {
        const char *name = argv[i], *value = argv[i + 1];
        if (!strcmp(name, "--host")) o.host = value;
        else if (!strcmp(name, "--port")) o.port = atoi(value);
        else if (!strcmp(name, "--robot")) o.robot = value;
        else if (!strcmp(name, "--view")) o.view = value;
        else if (!strcmp(name, "--viewers")) o.viewers = atoi(value);
        else if (!strcmp(name, "--sources")) o.sources = atoi(value);
        else if (!strcmp(name, "--seconds")) o.seconds = atof(value);
        else if (!strcmp(name, "--join")) o.join = atof(value);
        else fprintf(stderr, "lane_viewers: unknown option %s\n", name), exit(2);
    }
    if (o.port <= 0 || !o.robot || strlen(o.robot) > 64 || strlen(o.view) > 64 || o.viewers < 1 || o.viewers > VIEWERS_MAX ||
        o.sources < 1 || !(o.seconds > 0 && o.seconds <= 3600) || !(o.join >= 0 && o.join <= 60)) {
        fprintf(stderr, "usage: lane_viewers --port P --robot NAME --viewers N (1 to %d) …\n", VIEWERS_MAX);
        exit(2);
    }
}

int main(int argc, char **argv) {
    read_options(argc, argv);
    struct rlimit files;
    getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max;
    setrlimit(RLIMIT_NOFILE, &files);
    if (files.rlim_cur < (rlim_t)o.viewers + 64) {
        fprintf(stderr, "lane_viewers: %d viewers need more open files than %lu\n", o.viewers, (unsigned long)files.rlim_cur);
        return 2;
    }
    viewers = calloc((size_t)o.viewers, sizeof *viewers);
    slots = malloc(SLOTS * sizeof *slots);
    if (!viewers || !slots) return 2;
    memset(slots, 0xff, SLOTS * sizeof *slots);
    epoll = epoll_create1(0);
    struct epoll_event driver = {.events = EPOLLIN, .data.ptr = NULL};
    if (epoll_ctl(epoll, EPOLL_CTL_ADD, 0, &driver)) { /* a file or /dev/null: for all of --seconds */
        if (errno != EPERM) return 2;
    }
    started = now_ns();
    turned = started / (SLOT_MS * 1000000ull);
    for (int i = 0; i < o.viewers; i++) viewers[i].fd = -1, wait_ms(&viewers[i], (int64_t)(o.join * 1000 * i / o.viewers));
    for (int heard = 1; heard && (double)(now_ns() - started) * 1e-9 < o.seconds;) {
        struct epoll_event happened[256];
        int n = epoll_wait(epoll, happened, 256, SLOT_MS);
        for (int i = 0; i < n; i++) {
            struct viewer *v = happened[i].data.ptr;
            if (!v) heard = hear_driver();
            else if (v->fd < 0) continue; /* hung up in this very turn */
            else if (v->phase == CONNECTING) {
                if (happened[i].events & EPOLLERR) {
                    lose(v);
                    continue;
                }
                struct epoll_event e = {.events = EPOLLIN, .data.ptr = v};
                epoll_ctl(epoll, EPOLL_CTL_MOD, v->fd, &e);
                ask(v);
            } else read_from(v);
        }
        turn();
        drop_silent();
    }
    report("end");
    return 0;
}
