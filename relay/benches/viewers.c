/* N viewers of one server in one thread: what reached them, when, how old it was, and what it cost the server.
 *
 *   viewers --mode steady|storm --port P --path /live --viewers N --stamps FILE [--host 127.0.0.1] [--seconds 8] [--settle 2]
 *           [--in-flight 256] [--sources 64] [--step 1] [--server-pid PID --server-core C] [--frozen K [--resume-after S]]
 *           [--subprotocol NAME] [--greet text:…|hex:…] [--skip BYTES] [--acks 0]
 *   viewers --mode lane|past --port P --robot NAME --viewers N [--host 127.0.0.1] [--view public] [--join 4] [--sources 64]
 *           [--seconds 600] [--every 5]
 *
 * --sources: loopback addresses to come from, so that neither ports nor a cap per address run out. Figures are one JSON object
 * on a line of stdout.
 *
 * By WebSocket. steady (when no mode is named): connect (at most --in-flight handshakes open at once), have the feed begin,
 * settle, measure for --seconds. storm: all connect at once; the measured window is the storm itself and one second more.
 * Viewers do what the page does: read at once, and send {"type":"ack","n":binary messages so far} when one arrives and a
 * second has passed since the last. --frozen K of them stop reading when the window begins (what SIGSTOP does to a
 * browser), for good or for --resume-after seconds. --step: how far seq moves from one frame to the next one due.
 * Other servers' protocols (benches/peers): --subprotocol is asked for, --greet is sent once as one message (hex: as a binary
 * one), --skip bytes stand before the frame in a binary message (where no frame follows, it is theirs), --acks 0 sends none.
 * permessage-deflate is not offered. Exit status 1 when viewers could not connect.
 *
 * lane: they read a robot's segments by HTTP as the page does. A viewer asks where the past ends (`/past?view=`), gets the
 * newest segment, and then each next one 0.8 s before it is due by what came before (the page's rule,
 * spa/src/stream/lane/lane.ts): the last one's end, the shortest of the last three durations, the least time from an end to the
 * arrival of the last ten. Until a request was held, and after two segments in a row that were there already, it asks at once,
 * and after each third such segment where the past ends: there it begins where that is more than three segments further (a cache
 * may have told an old end, and what it told before is nothing new). 204 → again after Retry-Ms; 200 with JSON → the segment
 * that it names; anything else, and a connection that breaks → again after 0 to 2 s, then twice that … up to 32 s. Each request
 * is under way for 0 to 0.2 s more, drawn anew, as over a network. Connections are kept, and opened anew when their server has
 * ended them. All have come after --join seconds.
 *
 * past: they look back. Each opens the past once, then in every --every seconds lets go of the time line somewhere: the index
 * and the first poses of those ten minutes, and two segments. (A page keeps what it has fetched and asks for less.) When all
 * have done so once, "READY" is printed and counting begins.
 *
 * In both, each line on standard input prints what was counted since the last one, with the line as `name`, and begins anew;
 * the end of standard input, or --seconds, prints the last one and ends. The exit status is then 0. `least`: the fewest segments
 * that any viewer got since the last line. `age`: from the moment at which the relay accepted a segment's first frame (unix ms,
 * in its header, of this machine's clock) until the last byte of it is here: as far is a viewer behind that plays steadily. A
 * viewer's first segment has no age: it is as old as it happens to be. `waited`: from asking to the last byte; of segments in
 * the lane, of everything in the past. Bytes are those of the socket, headers included; `packets` and `records` are what they
 * need at least: 1,448 bytes in a packet of Ethernet (TCP with timestamps), 16,384 in a record of TLS, each answer by itself. */
#define _GNU_SOURCE
#include "stamps.h"
#include <arpa/inet.h>
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <netinet/tcp.h>
#include <stddef.h>
#include <string.h>
#include <strings.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>

#define VIEWERS_MAX 20000

static struct {
    const char *host, *mode, *path, *stamps, *subprotocol, *greet, *robot, *view;
    int port, viewers, sources, in_flight, step, server_pid, server_core, frozen, skip, acks;
    double seconds, settle, resume_after, join, every;
} o = {.host = "127.0.0.1", .mode = "steady", .path = "/", .view = "public", .sources = 64, .in_flight = 256, .step = 1,
       .server_core = -1, .acks = 1, .settle = 2, .join = 4, .every = 5};

enum phase { RESTING, CONNECTING, ASKED, OPEN, CLOSED };

#define SPANS 3
#define CLOSES 10
#define HEAD_MAX 2048u /* of an answer; a longer one is an error */

struct viewer {
    int fd; /* -1: no connection */
    enum phase phase;
    uint32_t mine;     /* frames in the window, or segments since the last report */
    uint64_t asked_ns; /* when it began to connect, or to ask */
    uint8_t *kept;     /* the start of a message whose end has not come; or of an answer's body */
    size_t kept_size;
    union {
        struct { /* by WebSocket */
            uint8_t frozen, has_seq;
            uint32_t seq, key_id, ref_id; /* newest seen; the bases this connection was given */
            uint32_t binaries;
            uint32_t held_id; /* of a base that the next frame will tell to be due or not; 0: none */
            uint64_t held_us, held_read_ns, acked_ns, gone_ns;
        };
        struct { /* by HTTP */
            uint8_t used, errors; /* the connection has answered; in a row */
            uint64_t take;
            uint32_t index;       /* with `take`: what to ask for */
            int64_t body_left;
            uint32_t head_size, got;
            int next; /* in its slot */
            char head[HEAD_MAX];
            union {
                struct { /* in the lane */
                    uint8_t found, told_not_yet; /* a request was held: so it is known when segments come */
                    uint8_t knows, begun, run_known; /* knows what to ask for; has a segment; which run it is of */
                    uint32_t last_seq;
                    uint64_t run;
                    uint32_t arrived; /* segments, in all */
                    uint32_t ready; /* segments in a row that were there already */
                    uint64_t told_take; /* what was told to be the newest at last */
                    uint32_t told_index;
                    int64_t spans_ms[SPANS], closes_ms[CLOSES]; /* of the newest ones: duration, and arrival less end */
                };
                struct { /* in the past */
                    uint8_t step, parts; /* what to ask for now; segments that are left of a look */
                    int64_t from_ms, to_ms; /* of the past */
                    uint64_t due_ns, takes[2];
                    uint32_t indexes[2];
                    char page[20];
                };
            };
        };
    };
};

static const struct mode {
    void (*connected)(struct viewer *), (*readable)(struct viewer *), (*lost)(struct viewer *);
} *mode;

static struct viewer *viewers;
static int epoll;
static uint64_t window_began; /* all that is measured is since then, ns */

#define COUNTS(X) \
    X(messages) X(along) X(bytes) X(received) X(texts) X(keys) X(acks) X(duplicates) X(reordered) X(orphans) X(unstamped) X(closed) \
    X(missed) X(unreadable) X(opened) X(segments) X(first) X(frames) X(gaps) X(repeats) X(not_yet) X(nexts) X(summaries) X(lost) \
    X(silent) X(asked) X(sent) X(heads) X(bodies) X(packets) X(records) X(segment_heads) X(segment_bodies)
#define MEMBER(name) name,
static struct { uint64_t COUNTS(MEMBER) none; } seen;
static uint32_t by_number[5000]; /* close codes, or statuses of refusals */

/* ---- figures ------------------------------------------------------------------------ */

/* Latencies in whole microseconds, 64 buckets per power of two: every figure read back is within 1.6 %. */
#define SUB_BITS 6
#define BUCKETS ((64 - SUB_BITS) << SUB_BITS)

struct histogram {
    uint64_t count[BUCKETS];
    uint64_t total, max_us;
};
static struct histogram lateness, handshake, age, waited;

static void histogram_add(struct histogram *h, uint64_t us) {
    unsigned shift = us < (1u << SUB_BITS) ? 0 : 63u - (unsigned)__builtin_clzll(us) - SUB_BITS;
    unsigned row = us < (1u << SUB_BITS) ? 0 : shift + 1;
    h->count[(row << SUB_BITS) + (unsigned)((us >> shift) & ((1u << SUB_BITS) - 1))]++;
    h->total++;
    if (us > h->max_us) h->max_us = us;
}

/* The value below which `share` (0…1) of the entries lie, in ms; 0 when empty. */
static double histogram_ms(const struct histogram *h, double share) {
    uint64_t wanted = (uint64_t)(share * (double)h->total), below = 0;
    for (unsigned i = 0; i < BUCKETS; i++) {
        unsigned row = i >> SUB_BITS, column = i & ((1u << SUB_BITS) - 1);
        below += h->count[i];
        if (below > wanted) return (double)(row ? (uint64_t)((1u << SUB_BITS) + column) << (row - 1) : column) / 1000.0;
    }
    return (double)h->max_us / 1000.0;
}

static void print_ms(const char *name, const struct histogram *h) {
    printf("\"%s\":{\"p50\":%.2f,\"p95\":%.2f,\"p99\":%.2f,\"p999\":%.2f,\"max\":%.2f},", name, histogram_ms(h, .5),
           histogram_ms(h, .95), histogram_ms(h, .99), histogram_ms(h, .999), (double)h->max_us / 1000);
}

static void print_by_number(const char *name) {
    printf("\"%s\":{", name);
    for (int i = 0, first = 1; i < 5000; i++)
        if (by_number[i]) printf("%s\"%d\":%u", first ? "" : ",", i, by_number[i]), first = 0;
    printf("},");
}

static void print_counts(void) {
#define PRINT(name) printf("\"" #name "\":%" PRIu64 ",", seen.name);
    COUNTS(PRINT)
}

static double s_since(uint64_t then) { return (double)(now_ns() - then) * 1e-9; }

static double own_cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

/* ---- connections -------------------------------------------------------------------- */

static void set_events(struct viewer *v, int how, uint32_t events) {
    struct epoll_event e = {.events = events, .data.ptr = v};
    epoll_ctl(epoll, how, v->fd, &e);
}

static void hang_up(struct viewer *v) {
    if (v->fd >= 0) close(v->fd);
    v->fd = -1;
}

/* Begins to connect, each from one of many loopback addresses. */
static void start(struct viewer *v) {
    int number = (int)(v - viewers) % o.sources, on = 1;
    struct linger reset = {1, 0}; /* leave no TIME_WAIT behind: thousands of ports are needed again at once */
    struct sockaddr_in from = {.sin_family = AF_INET}, to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)o.port)};
    v->fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
    if (v->fd < 0) {
        perror("viewers: socket");
        exit(1);
    }
    setsockopt(v->fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(v->fd, IPPROTO_IP, IP_BIND_ADDRESS_NO_PORT, &on, sizeof on);
    setsockopt(v->fd, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    set_events(v, EPOLL_CTL_ADD, EPOLLOUT);
    v->phase = CONNECTING;
    v->asked_ns = now_ns();
    from.sin_addr.s_addr = htonl(0x7f010001u + (uint32_t)(number / 200) * 256 + (uint32_t)(number % 200));
    inet_pton(AF_INET, o.host, &to.sin_addr);
    if (bind(v->fd, (struct sockaddr *)&from, sizeof from) ||
        (connect(v->fd, (struct sockaddr *)&to, sizeof to) && errno != EINPROGRESS))
        mode->lost(v);
}

/* 0 when standard input, which stands in epoll without a viewer, has something to say. */
static int poll_once(int limit_ms) {
    struct epoll_event happened[256];
    int n = epoll_wait(epoll, happened, 256, limit_ms), quiet = 1;
    for (int i = 0; i < n; i++) {
        struct viewer *v = happened[i].data.ptr;
        if (!v) quiet = 0;
        else if (v->fd < 0) continue; /* hung up in this very turn */
        else if (v->phase == CONNECTING && !(happened[i].events & EPOLLERR)) {
            set_events(v, EPOLL_CTL_MOD, EPOLLIN);
            mode->connected(v);
        } else if (v->phase == CONNECTING || (happened[i].events & EPOLLERR && v->phase == OPEN)) mode->lost(v);
        else mode->readable(v);
    }
    return quiet;
}

/* ---- frames, by WebSocket ------------------------------------------------------------- */

/* The header of wire format 1, as far as a seq needs it, and the newest bases that were seen (by anyone).
 *
 * A KEY carries its seq. Every other frame names its base by id (FNV-1a-32 of the base's whole message) and gives the
 * distance to it. Each base is hashed once for all viewers: a seq that is already known is not hashed again. */
#define BASES 64u

static struct base {
    uint32_t seq, id;
    uint8_t known;
} bases[BASES];

struct header {
    uint32_t seq, base_id; /* base_id: of the frame this one is coded against; 0 for a KEY */
    uint32_t own_id;       /* of this frame when others may be coded against it, else 0 */
    uint8_t is_key;
};

static uint32_t base_id(uint32_t seq, const uint8_t *bytes, size_t size) {
    struct base *slot = &bases[seq % BASES];
    if (slot->known && slot->seq == seq) return slot->id;
    uint32_t hash = 2166136261u;
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * 16777619u;
    *slot = (struct base){seq, hash, 1};
    return hash;
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

#define READ_AT_ONCE 65536u
#define GIVE_UP_S 60.0 /* handshakes not done by then have failed */
#define STALE_S 1.0    /* a frame older than this, read after a freeze, is backlog */

static uint64_t *stamps;
static int waiting, failed, measuring; /* handshakes under way, lost */
static uint64_t last_opened_ns;
static double backlog_s;

static void lose_live(struct viewer *v) {
    if (v->phase == CLOSED) return;
    if (v->phase != OPEN) waiting--, failed++;
    else if (!v->frozen) seen.closed++;
    v->phase = CLOSED;
    v->gone_ns = now_ns();
    hang_up(v);
}

static void send_masked(struct viewer *v, uint8_t opcode, const uint8_t *payload, size_t size) {
    static const uint8_t mask[4] = {0x5a, 0x11, 0xc3, 0x7e};
    uint8_t out[6 + 125] = {(uint8_t)(0x80 | opcode), (uint8_t)(0x80 | size)};
    memcpy(out + 2, mask, 4);
    for (size_t i = 0; i < size; i++) out[6 + i] = payload[i] ^ mask[i & 3];
    if (send(v->fd, out, 6 + size, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)(6 + size)) lose_live(v);
}

static void acknowledge(struct viewer *v, uint64_t now) {
    if (!o.acks || now - v->acked_ns < 1000000000ull) return;
    char text[64];
    int size = snprintf(text, sizeof text, "{\"type\":\"ack\",\"n\":%u}", v->binaries);
    v->acked_ns = now;
    seen.acks++;
    send_masked(v, 1, (uint8_t *)text, (size_t)size);
}

static void greet(struct viewer *v) {
    uint8_t bytes[125];
    size_t size = 0;
    int binary = !strncmp(o.greet, "hex:", 4);
    const char *from = strchr(o.greet, ':') + 1;
    if (binary) while (size < sizeof bytes && sscanf(from + 2 * size, "%2hhx", &bytes[size]) == 1) size++;
    else memcpy(bytes, from, size = strlen(from));
    send_masked(v, binary ? 2 : 1, bytes, size);
}

/* How many due frames lie between two seqs: a KEY handed over as a base sits between two due ones and is none. */
static uint32_t missed_between(uint32_t before, uint32_t after) {
    uint32_t due = (after - before + (uint32_t)o.step / 2) / (uint32_t)o.step;
    return due > 1 ? due - 1 : 0;
}

static void count_due(struct viewer *v, uint64_t late_us) {
    seen.messages++;
    v->mine++;
    if (late_us) histogram_add(&lateness, late_us); /* 0: not stamped */
}

/* Where fewer frames are due than the robot makes, a base that was not due comes along with the frame that stands on it,
 * in one write. It is no delivery of its own, and its age is no lateness. */
static void settle_base(struct viewer *v, uint32_t stands_on, uint64_t read_ns) {
    if (v->held_id && v->held_id == stands_on && v->held_read_ns == read_ns) seen.along++;
    else if (v->held_id) count_due(v, v->held_us);
    v->held_id = 0;
}

static void take_frame(struct viewer *v, const uint8_t *bytes, size_t size, uint64_t now) {
    struct header h;
    if (o.skip && size < (size_t)o.skip + 9) return; /* the other protocol's own */
    bytes += o.skip, size -= (size_t)o.skip;
    v->binaries++;
    if (!read_header(bytes, size, &h)) {
        seen.unreadable += !o.skip; /* with --skip it is the other protocol's own, too */
        return;
    }
    if (!h.is_key && h.base_id != v->key_id && h.base_id != v->ref_id) seen.orphans++;
    if (h.is_key) v->key_id = h.own_id, v->ref_id = 0;
    else if (h.own_id) v->ref_id = h.own_id;

    uint64_t stamp = stamps[h.seq % STAMP_SLOTS];
    uint64_t late_ns = stamp && now > stamp ? now - stamp : 0;
    if (measuring && v->frozen && !h.own_id && (double)late_ns > STALE_S * 1e9) { /* bases are old by nature */
        double after = ((double)stamp - (double)window_began) * 1e-9; /* published so long after the freeze */
        if (after > backlog_s) backlog_s = after;
    }
    if (measuring && !v->frozen) {
        seen.bytes += size;
        seen.keys += h.is_key;
        settle_base(v, h.base_id, now);
        if (h.own_id && o.step > 1) v->held_id = h.own_id, v->held_us = late_ns / 1000, v->held_read_ns = now;
        else count_due(v, late_ns / 1000);
        if (!stamp) seen.unstamped++;
        if (v->has_seq && h.seq == v->seq) seen.duplicates++;
        else if (v->has_seq && (int32_t)(h.seq - v->seq) < 0) seen.reordered += h.own_id == 0 || h.is_key;
        else if (v->has_seq) seen.missed += missed_between(v->seq, h.seq);
    }
    if (!v->has_seq || (int32_t)(h.seq - v->seq) > 0) v->seq = h.seq;
    v->has_seq = 1;
}

/* Takes whole messages off the front; says how many bytes were used. */
static size_t take_messages(struct viewer *v, const uint8_t *bytes, size_t size, uint64_t now) {
    size_t used = 0;
    while (v->phase == OPEN && size - used >= 2) {
        const uint8_t *at = bytes + used;
        size_t head = 2, length = at[1] & 127;
        if (length == 126) head = 4;
        if (length == 127) head = 10;
        if (size - used < head) break;
        if (head > 2) {
            length = 0;
            for (size_t i = 2; i < head; i++) length = length << 8 | at[i];
        }
        if (at[1] & 0x80 || !(at[0] & 0x80) || length > READ_AT_ONCE * 16) { /* masked, torn or absurd */
            seen.unreadable++;
            lose_live(v);
            break;
        }
        if (size - used < head + length) break;
        const uint8_t *payload = at + head;
        used += head + length;
        switch (at[0] & 15) {
        case 1: seen.texts += measuring && !v->frozen; break;
        case 2:
            take_frame(v, payload, length, now);
            acknowledge(v, now);
            break;
        case 8:
            if (length >= 2) by_number[(payload[0] << 8 | payload[1]) % 5000]++;
            lose_live(v);
            break;
        case 9: send_masked(v, 10, payload, length < 126 ? length : 0); break;
        default: break;
        }
    }
    return used;
}

static size_t take_upgrade(struct viewer *v, const uint8_t *bytes, size_t size, uint64_t now) {
    uint8_t *end = memmem(bytes, size, "\r\n\r\n", 4);
    if (!end) return 0;
    size_t length = (size_t)(end - bytes) + 4;
    if (size < 12 || memcmp(bytes + 9, "101", 3) || !memmem(bytes, length, "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=", 28)) {
        if (!failed) fprintf(stderr, "viewers: refused: %.*s\n", (int)(length < 60 ? length : 60), bytes);
        lose_live(v);
        return length;
    }
    v->phase = OPEN;
    waiting--;
    seen.opened++;
    last_opened_ns = now;
    histogram_add(&handshake, (now - v->asked_ns) / 1000);
    if (o.greet) greet(v);
    return length;
}

static void read_live(struct viewer *v) {
    static uint8_t heard[READ_AT_ONCE * 20];
    if (v->frozen == 1) { /* it hears only of its end */
        lose_live(v);
        return;
    }
    size_t size = v->kept_size;
    if (size) memcpy(heard, v->kept, size);
    ssize_t n = recv(v->fd, heard + size, READ_AT_ONCE, MSG_DONTWAIT);
    if (n <= 0) {
        if (n == 0 || errno != EAGAIN) lose_live(v);
        return;
    }
    uint64_t now = now_ns();
    if (measuring && !v->frozen) seen.received += (uint64_t)n;
    size += (size_t)n;
    size_t used = v->phase == ASKED ? take_upgrade(v, heard, size, now) : 0;
    used += take_messages(v, heard + used, size - used, now);
    v->kept_size = v->phase == CLOSED ? 0 : size - used;
    if (v->kept_size) {
        v->kept = realloc(v->kept, v->kept_size);
        memcpy(v->kept, heard + used, v->kept_size);
    }
}

static void ask_upgrade(struct viewer *v) {
    char text[512];
    int size = snprintf(text, sizeof text,
                        "GET %s HTTP/1.1\r\nHost: %s:%d\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n%s%s%s\r\n",
                        o.path, o.host, o.port, o.subprotocol ? "Sec-WebSocket-Protocol: " : "",
                        o.subprotocol ? o.subprotocol : "", o.subprotocol ? "\r\n" : "");
    v->phase = ASKED;
    if (send(v->fd, text, (size_t)size, MSG_NOSIGNAL) != size) lose_live(v);
}

static void freeze(int frozen) {
    for (int i = 0, left = o.frozen; i < o.viewers && left > 0; i += o.viewers / o.frozen, left--) {
        struct viewer *v = &viewers[i];
        if (v->phase != OPEN) continue;
        v->frozen = frozen ? 1 : 2; /* 2: reads again, still not counted among the healthy */
        set_events(v, EPOLL_CTL_MOD, frozen ? EPOLLRDHUP : EPOLLIN);
    }
}

struct server {
    double ran_s;  /* all threads of the server; softirq in its context is included */
    double busy_s; /* its core, whoever had it: what goes beyond ran_s was a neighbour's */
    double rss_mb;
};

static double core_busy_s(void) {
    char line[256], name[16];
    double busy = 0;
    FILE *f = o.server_core < 0 ? NULL : fopen("/proc/stat", "r");
    snprintf(name, sizeof name, "cpu%d ", o.server_core);
    while (f && fgets(line, sizeof line, f)) {
        unsigned long long user, nice, system, idle, iowait, irq, softirq, steal;
        if (!strncmp(line, name, strlen(name)) && sscanf(line + strlen(name), "%llu %llu %llu %llu %llu %llu %llu %llu", &user,
                                                         &nice, &system, &idle, &iowait, &irq, &softirq, &steal) == 8)
            busy = (double)(user + nice + system + irq + softirq + steal) / (double)sysconf(_SC_CLK_TCK);
    }
    if (f) fclose(f);
    return busy;
}

static struct server look_at_server(void) {
    char path[300];
    struct server now = {.busy_s = core_busy_s()};
    snprintf(path, sizeof path, "/proc/%d/task", o.server_pid);
    DIR *tasks = o.server_pid ? opendir(path) : NULL;
    for (struct dirent *d; tasks && (d = readdir(tasks));) {
        unsigned long long ran = 0;
        snprintf(path, sizeof path, "/proc/%d/task/%s/schedstat", o.server_pid, d->d_name);
        FILE *f = d->d_name[0] == '.' ? NULL : fopen(path, "r");
        if (!f) continue;
        if (fscanf(f, "%llu", &ran) == 1) now.ran_s += (double)ran * 1e-9;
        fclose(f);
    }
    if (tasks) closedir(tasks);
    long size = 0, resident = 0;
    snprintf(path, sizeof path, "/proc/%d/statm", o.server_pid);
    FILE *f = o.server_pid ? fopen(path, "r") : NULL;
    if (f && fscanf(f, "%ld %ld", &size, &resident) == 2) now.rss_mb = (double)resident * (double)sysconf(_SC_PAGESIZE) / 1e6;
    if (f) fclose(f);
    return now;
}

/* Of the frames that those who read all the time got. */
static double jain(void) {
    double sum = 0, squares = 0, n = 0;
    for (int i = 0; i < o.viewers; i++) {
        if (viewers[i].frozen || viewers[i].phase != OPEN) continue;
        sum += viewers[i].mine;
        squares += (double)viewers[i].mine * viewers[i].mine;
        n++;
    }
    return squares > 0 ? sum * sum / (n * squares) : 0;
}

static void report_frozen(void) {
    int gone = 0;
    double last = 0;
    for (int i = 0; i < o.viewers; i++) {
        if (!viewers[i].frozen || viewers[i].phase != CLOSED) continue;
        double after = (double)(viewers[i].gone_ns - window_began) * 1e-9;
        gone++;
        if (after > last) last = after;
    }
    printf("\"frozen\":{\"count\":%d,\"gone\":%d,\"last_gone_s\":%.2f,\"backlog_s\":%.2f},", o.frozen, gone, last, backlog_s);
}

static int play_live(void) {
    static const struct mode LIVE = {ask_upgrade, read_live, lose_live};
    mode = &LIVE;
    stamps = open_stamps(o.stamps);
    int storm = !strcmp(o.mode, "storm");
    struct server idle = look_at_server(), before = idle;
    double own = own_cpu_s();
    uint64_t connect_began = now_ns();
    window_began = connect_began;
    measuring = storm;
    for (int next = 0; (int)seen.opened + failed < o.viewers && s_since(connect_began) < GIVE_UP_S;) {
        while (next < o.viewers && (storm || waiting < o.in_flight)) waiting++, start(&viewers[next++]);
        poll_once(100);
    }
    double connect_s = (double)(last_opened_ns - connect_began) * 1e-9;
    uint64_t settled = now_ns();
    stamps[ALL_CONNECTED] = !storm;
    while (s_since(settled) < (storm ? 1.0 : o.settle)) poll_once(20);

    struct server full = look_at_server();
    if (!storm) {
        before = look_at_server(), own = own_cpu_s();
        freeze(o.frozen);
        window_began = now_ns();
        measuring = 1;
        for (int resumed = 0; s_since(window_began) < o.seconds;) {
            poll_once(20);
            if (o.resume_after > 0 && !resumed && s_since(window_began) >= o.resume_after) freeze(0), resumed = 1;
        }
        measuring = 0;
    }
    double wall = s_since(window_began);
    struct server after = look_at_server();
    own = own_cpu_s() - own;

    printf("{\"viewers\":%d,\"failed\":%d,\"connect_s\":%.4f,\"handshakes_per_s\":%.1f,", o.viewers, o.viewers - (int)seen.opened,
           connect_s, connect_s > 0 ? (double)seen.opened / connect_s : 0);
    printf("\"window_began_s\":%.6f,\"wall_s\":%.4f,", (double)window_began * 1e-9, wall);
    print_counts();
    print_ms("handshake_ms", &handshake);
    print_ms("lateness_ms", &lateness);
    if (o.frozen) report_frozen();
    print_by_number("closings");
    printf("\"jain\":%.5f,\"generator_share\":%.3f,\"server_cpu_s\":%.4f,\"core_busy_s\":%.4f,", jain(), own / wall,
           after.ran_s - before.ran_s, after.busy_s - before.busy_s);
    printf("\"rss_mb\":{\"idle\":%.2f,\"connected\":%.2f,\"end\":%.2f}}\n", idle.rss_mb, full.rss_mb, after.rss_mb);
    return (int)seen.opened == o.viewers ? 0 : 1;
}

/* ---- answers, by HTTP ------------------------------------------------------------------ */

#define BODY_MAX (3u << 20)
#define SLOT_MS 5
#define SLOTS 16384u /* of SLOT_MS: 81 s, longer than any wait */
#define PATIENCE_S 30.0 /* for an answer */
#define BACK_OFF_MS 2000 /* at most, the first time */
#define BACK_OFFS 4 /* times it doubles */
#define PACKET 1448u
#define RECORD 16384u

static size_t kept_max; /* of a body */
static int *slots;
static uint64_t turned; /* slots that are over */
static size_t (*make_path)(const struct viewer *, char *, size_t); /* of what a viewer wants now, below its robot's past */
static void (*take_answer)(struct viewer *, int, size_t, size_t);  /* status, bytes of its head and of its body */

static int64_t draw(int64_t below) {
    static uint64_t state = 88172645463325252ull;
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return (int64_t)(state % (uint64_t)below);
}

static void wait_ms(struct viewer *v, int64_t ms) {
    if (ms < 0) ms = 0;
    if (ms > (int64_t)(SLOTS - 2) * SLOT_MS) ms = (int64_t)(SLOTS - 2) * SLOT_MS;
    uint64_t slot = now_ns() / (SLOT_MS * 1000000ull) + 1 + (uint64_t)ms / SLOT_MS;
    if (slot <= turned) slot = turned + 1;
    v->phase = RESTING;
    v->next = slots[slot % SLOTS];
    slots[slot % SLOTS] = (int)(v - viewers);
}

static void back_off(struct viewer *v) {
    int64_t ms = (int64_t)BACK_OFF_MS << v->errors;
    if (v->errors < BACK_OFFS) v->errors++;
    wait_ms(v, draw(ms));
}

static void lose_asking(struct viewer *v) {
    hang_up(v);
    seen.lost++;
    back_off(v);
}

static void ask(struct viewer *v) {
    char text[600], path[200];
    make_path(v, path, sizeof path);
    int size = snprintf(text, sizeof text, "GET /api/v1/robots/%s/past%s HTTP/1.1\r\nHost: %s:%d\r\n\r\n", o.robot, path, o.host, o.port);
    v->phase = ASKED;
    v->asked_ns = now_ns();
    v->head_size = v->got = 0;
    v->kept_size = 0;
    v->body_left = -1;
    seen.asked++;
    if (send(v->fd, text, (size_t)size, MSG_NOSIGNAL) != size) lose_asking(v);
    else seen.sent += (uint64_t)size;
}

static void go_on(struct viewer *v) {
    if (v->fd >= 0) {
        ask(v);
        return;
    }
    v->used = 0;
    seen.opened++;
    start(v);
}

static long find_number(const struct viewer *v, const char *name) { /* a header's; -1: it isn't there */
    const char *at = v->head, *end = at + v->head_size;
    size_t length = strlen(name);
    while ((at = memmem(at, (size_t)(end - at), "\r\n", 2)) && (size_t)(end - at) > length + 3) {
        at += 2;
        if (!strncasecmp(at, name, length) && at[length] == ':') return atol(at + length + 1);
    }
    return -1;
}

static int status_of(const struct viewer *v) { return v->head_size > 12 ? atoi(v->head + 9) : 0; }

static void take_whole(struct viewer *v) {
    int status = status_of(v), closes = 0;
    size_t head = v->head_size, body = v->got - v->head_size;
    static const char END[] = "connection: close";
    for (size_t i = 0; i + sizeof END - 1 <= head; i++) closes |= !strncasecmp(v->head + i, END, sizeof END - 1);
    seen.heads += head, seen.bodies += body;
    seen.packets += (v->got + PACKET - 1) / PACKET, seen.records += (v->got + RECORD - 1) / RECORD;
    v->used = 1;
    if (closes) hang_up(v);
    if (status == 200 || status == 204) v->errors = 0;
    else by_number[status > 0 && status < 600 ? status : 0]++;
    v->kept[v->kept_size] = 0;
    take_answer(v, status, head, body);
}

/* Takes bytes of the answer; 0 when the connection can't go on. */
static int take_bytes(struct viewer *v, const uint8_t *bytes, size_t size) {
    if (v->body_left < 0) {
        size_t before = v->head_size, room = HEAD_MAX - before, more = size < room ? size : room;
        memcpy(v->head + before, bytes, more);
        char *end = memmem(v->head, before + more, "\r\n\r\n", 4);
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
    size_t keep = kept_max - v->kept_size < size ? kept_max - v->kept_size : size;
    memcpy(v->kept + v->kept_size, bytes, keep);
    v->kept_size += keep, v->got += (uint32_t)size, v->body_left -= (int64_t)size;
    if (!v->body_left) take_whole(v);
    return 1;
}

static void read_answer(struct viewer *v) {
    static uint8_t heard[READ_AT_ONCE];
    ssize_t n = recv(v->fd, heard, sizeof heard, MSG_DONTWAIT);
    if (n < 0 && errno == EAGAIN) return;
    if (v->phase != ASKED) { /* ended while nothing was asked for, as servers do */
        hang_up(v);
        return;
    }
    if (n > 0 && take_bytes(v, heard, (size_t)n)) return;
    int again = n <= 0 && v->used && !v->got; /* it ended just when it was asked: browsers ask once more */
    if (again) hang_up(v), go_on(v);
    else lose_asking(v);
}

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
    if (s_since(swept) < 1.0) return;
    swept = now_ns();
    for (int i = 0; i < o.viewers; i++)
        if (viewers[i].phase != RESTING && s_since(viewers[i].asked_ns) > PATIENCE_S) seen.silent++, lose_asking(&viewers[i]);
}

/* What was counted since the last one; `name` NULL: begin anew only. */
static void report(const char *name) {
    static double own;
    double wall = s_since(window_began);
    uint32_t least = UINT32_MAX;
    for (int i = 0; i < o.viewers; i++) {
        if (viewers[i].mine < least) least = viewers[i].mine;
        viewers[i].mine = 0;
    }
    if (name) {
        printf("{\"name\":\"%s\",\"viewers\":%d,\"wall_s\":%.4f,\"least\":%u,", name, o.viewers, wall, least);
        print_counts();
        print_by_number("refused");
        print_ms("age_ms", &age);
        print_ms("waited_ms", &waited);
        printf("\"generator_share\":%.3f}\n", wall > 0 ? (own_cpu_s() - own) / wall : 0);
        fflush(stdout);
    }
    memset(&seen, 0, sizeof seen), memset(by_number, 0, sizeof by_number);
    memset(&age, 0, sizeof age), memset(&waited, 0, sizeof waited);
    window_began = now_ns(), own = own_cpu_s();
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

static int play_asking(void) {
    static const struct mode ASKING = {ask, read_answer, lose_asking};
    mode = &ASKING;
    slots = malloc(SLOTS * sizeof *slots);
    if (!slots) return 2;
    memset(slots, 0xff, SLOTS * sizeof *slots);
    struct epoll_event driver = {.events = EPOLLIN, .data.ptr = NULL};
    if (epoll_ctl(epoll, EPOLL_CTL_ADD, 0, &driver) && errno != EPERM) return 2; /* EPERM: a file, so for all of --seconds */
    uint64_t started = window_began = now_ns();
    turned = started / (SLOT_MS * 1000000ull);
    for (int i = 0; i < o.viewers; i++) {
        viewers[i].kept = malloc(kept_max + 1);
        if (!viewers[i].kept) return 2;
        wait_ms(&viewers[i], (int64_t)(o.join * 1000 * i / o.viewers));
    }
    for (int heard = 1; heard && s_since(started) < o.seconds;) {
        if (!poll_once(SLOT_MS)) heard = hear_driver();
        turn();
        drop_silent();
    }
    report("end");
    return 0;
}

/* ---- the lane -------------------------------------------------------------------------- */

#define LANE_KEPT_MAX 512u /* a segment's header as far as it is read here */
#define AHEAD_MS 800
#define WAY_MS 200 /* at most */
#define RETRY_MS 1000
#define EMPTY_MS 3000
#define HELD_US 300000
#define LOOK_EVERY 3 /* segments in a row that were there already */
#define MISSED_MAX 3 /* of so many each is fetched */

static size_t make_lane_path(const struct viewer *v, char *path, size_t size) {
    if (!v->knows) return (size_t)snprintf(path, size, "?view=%s", o.view);
    return (size_t)snprintf(path, size, "/%s/%016" PRIx64 "/%u", o.view, v->take, v->index);
}

static int64_t least_of(const int64_t *ms, uint32_t known, uint32_t most) {
    int64_t least = ms[0];
    for (uint32_t i = 1; i < known && i < most; i++)
        if (ms[i] < least) least = ms[i];
    return least;
}

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
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    uint64_t us = (uint64_t)t.tv_sec * 1000000ull + (uint64_t)t.tv_nsec / 1000;
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

/* A segment's name behind `mark` in an answer; 0 where there is none. */
static int read_name(const char *text, const char *mark, uint64_t *take, uint32_t *index) {
    const char *at = strstr(text, mark);
    return at && sscanf(at + strlen(mark), "{\"take\":\"%16" SCNx64 "\",\"index\":%" SCNu32, take, index) == 2;
}

/* Of `{"next":{"take":"…","index":n}}` or of a summary's `newest`. */
static void take_name(struct viewer *v) {
    uint32_t index;
    uint64_t take;
    if (!read_name((char *)v->kept, v->knows ? "\"next\":" : "\"newest\":", &take, &index)) {
        seen.unreadable += v->knows; /* a summary: there is nothing yet */
        wait_ms(v, EMPTY_MS / 2 + draw(EMPTY_MS));
        return;
    }
    int same = v->knows && take == v->take && index == v->index;
    if (v->knows) seen.nexts++;
    else {
        seen.summaries++;
        int told_before = take == v->told_take && index == v->told_index;
        int64_t by = (int64_t)index + 1 - v->index; /* v->index is that of the one after the last */
        v->told_take = take, v->told_index = index;
        if (v->begun && (told_before || (take == v->take && by >= -1 && by <= MISSED_MAX))) take = v->take, index = v->index;
    }
    v->take = take, v->index = index, v->knows = 1;
    wait_ms(v, (same ? RETRY_MS : 0) + draw(WAY_MS));
}

static void take_lane_answer(struct viewer *v, int status, size_t head, size_t body) {
    if (status == 204) {
        long ms = find_number(v, "retry-ms");
        seen.not_yet++, v->told_not_yet = 1, v->ready = 0;
        if (ms < RETRY_MS || ms > 60000) ms = RETRY_MS;
        wait_ms(v, ms + draw(WAY_MS));
    } else if (status == 200 && v->kept_size && v->kept[0] == '{') take_name(v);
    else if (status == 200) take_segment(v, head, body);
    else {
        if (status == 404) v->knows = 0; /* gone: from where the past ends now */
        back_off(v);
    }
}

/* ---- the past -------------------------------------------------------------------------- */

#define PAST_KEPT_MAX 131072u /* an index */
#define PAGE_MS 600000
#define BEGINNING_MS 1000 /* until a past that has just begun is asked for again */

enum step { SUMMARY, DAY, INDEX, POSES, PART };

static void write_time(char *text, size_t size, const char *format, int64_t ms) {
    time_t s = (time_t)(ms / 1000);
    struct tm utc;
    strftime(text, size, format, gmtime_r(&s, &utc));
}

static size_t make_past_path(const struct viewer *v, char *path, size_t size) {
    char day[20];
    write_time(day, sizeof day, "%Y-%m-%d", v->to_ms);
    switch (v->step) {
    case SUMMARY: return (size_t)snprintf(path, size, "?view=%s", o.view);
    case DAY: return (size_t)snprintf(path, size, "/%s/%s", o.view, day);
    case PART: return (size_t)snprintf(path, size, "/%s/%016" PRIx64 "/%u", o.view, v->takes[v->parts - 1], v->indexes[v->parts - 1]);
    default: return (size_t)snprintf(path, size, "/%s/%s%s", o.view, v->page, v->step == POSES ? "/keys" : "");
    }
}

/* Two neighbours of the segments that an index names, or one, or none. */
static void choose_parts(struct viewer *v) {
    static const char MARK[] = "{\"take\":\"";
    int count = 0;
    for (const char *at = (char *)v->kept; (at = strstr(at, MARK)); at++) count++;
    int64_t first = count ? draw(count) : 0, number = 0;
    v->parts = 0;
    for (const char *at = (char *)v->kept; (at = strstr(at, MARK)) && v->parts < 2; at++)
        if (number++ >= first) v->parts += (uint8_t)read_name(at, "", &v->takes[v->parts], &v->indexes[v->parts]);
}

static void choose_page(struct viewer *v) {
    int64_t at_ms = v->from_ms + draw(v->to_ms - v->from_ms + 1);
    write_time(v->page, sizeof v->page, "%Y-%m-%dT%H:%MZ", at_ms - at_ms % PAGE_MS);
    v->step = INDEX;
}

/* Until the next look. When all have looked once, counting begins, nobody in step with others. */
static void rest(struct viewer *v) {
    static int ready;
    choose_page(v);
    if (ready == o.viewers) {
        uint64_t now = now_ns();
        v->due_ns += (uint64_t)(o.every * 1e9);
        if (v->due_ns < now) v->due_ns = now;
        wait_ms(v, (int64_t)((v->due_ns - now) / 1000000));
        return;
    }
    v->phase = RESTING;
    if (++ready < o.viewers) return;
    report(NULL);
    puts("READY");
    fflush(stdout);
    for (int i = 0; i < o.viewers; i++) {
        int64_t own_turn_ms = (int64_t)(o.every * 1000 * i / o.viewers);
        viewers[i].due_ns = now_ns() + (uint64_t)own_turn_ms * 1000000;
        wait_ms(&viewers[i], own_turn_ms);
    }
}

static void take_past_answer(struct viewer *v, int status, size_t head, size_t body) {
    if (status != 200) v->kept[0] = 0;
    char *text = (char *)v->kept, *from = strstr(text, "\"from_ms\":"), *to = strstr(text, "\"to_ms\":");
    (void)head, (void)body;
    histogram_add(&waited, (now_ns() - v->asked_ns) / 1000);
    switch (v->step) {
    case SUMMARY:
        if (!strstr(text, "\"newest\":{") || !from || !to) {
            wait_ms(v, BEGINNING_MS);
            return;
        }
        v->from_ms = atoll(from + strlen("\"from_ms\":")), v->to_ms = atoll(to + strlen("\"to_ms\":"));
        v->step = DAY;
        break;
    case DAY: choose_page(v); break;
    case INDEX:
        choose_parts(v);
        v->step = POSES;
        break;
    default:
        v->parts -= v->step == PART;
        v->step = PART;
        if (v->parts) break;
        rest(v);
        return;
    }
    go_on(v);
}

/* ---- beginning ------------------------------------------------------------------------- */

static void read_options(int argc, char **argv) {
    const struct { const char *name, **text; int *number; double *real; } known[] = {
        {"--host", &o.host, 0, 0}, {"--mode", &o.mode, 0, 0}, {"--path", &o.path, 0, 0}, {"--stamps", &o.stamps, 0, 0},
        {"--subprotocol", &o.subprotocol, 0, 0}, {"--greet", &o.greet, 0, 0}, {"--robot", &o.robot, 0, 0}, {"--view", &o.view, 0, 0},
        {"--port", 0, &o.port, 0}, {"--viewers", 0, &o.viewers, 0}, {"--sources", 0, &o.sources, 0}, {"--in-flight", 0, &o.in_flight, 0},
        {"--step", 0, &o.step, 0}, {"--server-pid", 0, &o.server_pid, 0}, {"--server-core", 0, &o.server_core, 0},
        {"--frozen", 0, &o.frozen, 0}, {"--skip", 0, &o.skip, 0}, {"--acks", 0, &o.acks, 0}, {"--seconds", 0, 0, &o.seconds},
        {"--settle", 0, 0, &o.settle}, {"--resume-after", 0, 0, &o.resume_after}, {"--join", 0, 0, &o.join}, {"--every", 0, 0, &o.every},
    };
    o.seconds = -1;
    for (int i = 1; i + 1 < argc; i += 2) {
        size_t k = 0;
        while (k < sizeof known / sizeof *known && strcmp(argv[i], known[k].name)) k++;
        if (k == sizeof known / sizeof *known) fprintf(stderr, "viewers: unknown option %s\n", argv[i]), exit(2);
        if (known[k].text) *known[k].text = argv[i + 1];
        else if (known[k].number) *known[k].number = atoi(argv[i + 1]);
        else *known[k].real = atof(argv[i + 1]);
    }
    int asks = !strcmp(o.mode, "lane") || !strcmp(o.mode, "past");
    if (o.seconds < 0) o.seconds = asks ? 600 : 8;
    if (o.greet && (strlen(o.greet) > 125 || (strncmp(o.greet, "text:", 5) && strncmp(o.greet, "hex:", 4)))) {
        fprintf(stderr, "viewers: --greet text:… or hex:…, at most 125 characters\n");
        exit(2);
    }
    if (o.port <= 0 || o.viewers < 1 || o.viewers > VIEWERS_MAX || o.sources < 1 || !(o.seconds > 0 && o.seconds <= 3600) ||
        (asks ? !o.robot || strlen(o.robot) > 64 || strlen(o.view) > 64 || !(o.join >= 0 && o.join <= 60) || !(o.every > 0 && o.every <= 60)
              : !o.stamps || o.step < 1 || o.frozen > o.viewers / 2 || (strcmp(o.mode, "steady") && strcmp(o.mode, "storm")))) {
        fprintf(stderr, "usage: viewers [--mode steady|storm] --port P --path PATH --viewers N (1 to %d) --stamps FILE …\n"
                        "       viewers --mode lane|past --port P --robot NAME --viewers N …\n", VIEWERS_MAX);
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
        fprintf(stderr, "viewers: %d viewers need more open files than %lu\n", o.viewers, (unsigned long)files.rlim_cur);
        return 2;
    }
    viewers = calloc((size_t)o.viewers, sizeof *viewers);
    if (!viewers) return 2;
    for (int i = 0; i < o.viewers; i++) viewers[i].fd = -1;
    epoll = epoll_create1(0);
    if (!strcmp(o.mode, "lane")) make_path = make_lane_path, take_answer = take_lane_answer, kept_max = LANE_KEPT_MAX;
    else if (!strcmp(o.mode, "past")) make_path = make_past_path, take_answer = take_past_answer, kept_max = PAST_KEPT_MAX;
    return take_answer ? play_asking() : play_live();
}
