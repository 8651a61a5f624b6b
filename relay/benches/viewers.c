/* N WebSocket viewers in one thread: what reached them, when, and what it cost the server.
 *
 *   viewers --port P --path /live --viewers N --stamps FILE [--host 127.0.0.1] [--mode steady|storm] [--seconds 8]
 *           [--settle 2] [--in-flight 256] [--sources 64] [--step 1] [--server-pid PID --server-core C] [--frozen K [--resume-after S]]
 *           [--subprotocol NAME] [--greet text:…|hex:…] [--skip BYTES] [--acks 0]
 *
 * steady: connect (at most --in-flight handshakes open at once), have the feed begin, settle, measure for --seconds.
 * storm:  all connect at once; the measured window is the storm itself and one second more.
 * Viewers do what the page does: read at once, and send {"type":"ack","n":binary messages so far} when one arrives and a
 * second has passed since the last. --frozen K of them stop reading when the window begins (what SIGSTOP does to a
 * browser), for good or for --resume-after seconds. --step: how far seq moves from one frame to the next one due.
 * --sources: loopback addresses to come from, so that neither ports nor a cap per address run out.
 * Other servers' protocols (benches/peers): --subprotocol is asked for, --greet is sent once as one message (hex: as a binary
 * one), --skip bytes stand before the frame in a binary message (where no frame follows, it is theirs), --acks 0 sends none.
 * permessage-deflate is not offered. Output: one JSON object on stdout; exit 1 when viewers could not connect. */
#define _GNU_SOURCE
#include "histogram.h"
#include "loopback.h"
#include "stamps.h"
#include "wire_header.h"
#include <dirent.h>
#include <errno.h>
#include <sys/epoll.h>
#include <sys/resource.h>

#define READ_AT_ONCE 65536u
#define GIVE_UP_S 60.0 /* handshakes not done by then have failed */
#define STALE_S 1.0    /* a frame older than this, read after a freeze, is backlog */

enum phase { IDLE, CONNECTING, UPGRADING, OPEN, CLOSED };

struct viewer {
    int fd;
    enum phase phase;
    uint8_t frozen, has_seq;
    uint32_t seq, key_id, ref_id; /* newest seen; the bases this connection was given */
    uint32_t binaries, in_window;
    uint32_t held_id; /* of a base that the next frame will tell to be due or not; 0: none */
    uint64_t held_us, held_read_ns;
    uint64_t began_ns, acked_ns, gone_ns;
    uint8_t *kept; /* the start of a message whose end has not come */
    size_t kept_size;
};

static struct {
    const char *host, *path, *mode, *stamps, *subprotocol, *greet;
    int port, viewers, in_flight, sources, step, server_pid, server_core, frozen, skip, acks;
    double seconds, settle, resume_after;
} o = {.acks = 1, .host = "127.0.0.1", .path = "/", .mode = "steady", .in_flight = 256, .sources = 64, .step = 1, .seconds = 8, .settle = 2, .server_core = -1};

static struct viewer *viewers;
static uint64_t *stamps;
static int epoll;
static struct histogram lateness, handshake;
static int opened, waiting, failed; /* handshakes done, under way, lost */
static int measuring;
static uint64_t window_began, last_opened_ns;
static struct {
    uint64_t frames, along, bytes, received, texts, keys, duplicates, reordered, missed, orphans, unreadable, unstamped, closed, acks;
    double backlog_s;
} seen;
static uint32_t closings[5000];

static double s_since(uint64_t then) { return (double)(now_ns() - then) * 1e-9; }

static void lose(struct viewer *v) {
    if (v->phase == CLOSED) return;
    if (v->phase != OPEN) waiting--, failed++;
    else if (!v->frozen) seen.closed++;
    v->phase = CLOSED;
    v->gone_ns = now_ns();
    close(v->fd);
}

static void send_masked(struct viewer *v, uint8_t opcode, const uint8_t *payload, size_t size) {
    static const uint8_t mask[4] = {0x5a, 0x11, 0xc3, 0x7e};
    uint8_t out[6 + 125] = {(uint8_t)(0x80 | opcode), (uint8_t)(0x80 | size)};
    memcpy(out + 2, mask, 4);
    for (size_t i = 0; i < size; i++) out[6 + i] = payload[i] ^ mask[i & 3];
    if (send(v->fd, out, 6 + size, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)(6 + size)) lose(v);
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
    seen.frames++;
    v->in_window++;
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
        seen.unreadable += !o.skip; /* with --skip likewise */
        return;
    }
    if (!h.is_key && h.base_id != v->key_id && h.base_id != v->ref_id) seen.orphans++;
    if (h.is_key) v->key_id = h.own_id, v->ref_id = 0;
    else if (h.own_id) v->ref_id = h.own_id;

    uint64_t stamp = stamps[h.seq % STAMP_SLOTS];
    uint64_t late_ns = stamp && now > stamp ? now - stamp : 0;
    if (measuring && v->frozen && !h.own_id && (double)late_ns > STALE_S * 1e9) { /* bases are old by nature */
        double after = ((double)stamp - (double)window_began) * 1e-9; /* published so long after the freeze */
        if (after > seen.backlog_s) seen.backlog_s = after;
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
            lose(v);
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
            if (length >= 2) closings[(payload[0] << 8 | payload[1]) % 5000]++;
            lose(v);
            break;
        case 9: send_masked(v, 10, payload, length < 126 ? length : 0); break;
        default: break;
        }
    }
    return used;
}

static size_t take_answer(struct viewer *v, const uint8_t *bytes, size_t size, uint64_t now) {
    uint8_t *end = memmem(bytes, size, "\r\n\r\n", 4);
    if (!end) return 0;
    size_t length = (size_t)(end - bytes) + 4;
    if (size < 12 || memcmp(bytes + 9, "101", 3) || !memmem(bytes, length, "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=", 28)) {
        if (!failed) fprintf(stderr, "viewers: refused: %.*s\n", (int)(length < 60 ? length : 60), bytes);
        lose(v);
        return length;
    }
    v->phase = OPEN;
    waiting--;
    opened++;
    last_opened_ns = now;
    histogram_add(&handshake, (now - v->began_ns) / 1000);
    if (o.greet) greet(v);
    return length;
}

static void read_from(struct viewer *v) {
    static uint8_t heard[READ_AT_ONCE * 20];
    size_t size = v->kept_size;
    if (size) memcpy(heard, v->kept, size);
    ssize_t n = recv(v->fd, heard + size, READ_AT_ONCE, MSG_DONTWAIT);
    if (n <= 0) {
        if (n == 0 || errno != EAGAIN) lose(v);
        return;
    }
    uint64_t now = now_ns();
    if (measuring && !v->frozen) seen.received += (uint64_t)n;
    size += (size_t)n;
    size_t used = v->phase == UPGRADING ? take_answer(v, heard, size, now) : 0;
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
    v->phase = UPGRADING;
    struct epoll_event e = {.events = EPOLLIN, .data.ptr = v};
    epoll_ctl(epoll, EPOLL_CTL_MOD, v->fd, &e);
    if (send(v->fd, text, (size_t)size, MSG_NOSIGNAL) != size) lose(v);
}

static void start(struct viewer *v, int number) {
    v->fd = open_socket("viewers");
    struct epoll_event e = {.events = EPOLLOUT, .data.ptr = v};
    epoll_ctl(epoll, EPOLL_CTL_ADD, v->fd, &e);
    v->phase = CONNECTING;
    v->began_ns = now_ns();
    waiting++;
    if (!begin_connect(v->fd, o.host, o.port, number % o.sources)) lose(v);
}

static void poll_once(int limit_ms) {
    struct epoll_event happened[256];
    int n = epoll_wait(epoll, happened, 256, limit_ms);
    for (int i = 0; i < n; i++) {
        struct viewer *v = happened[i].data.ptr;
        if (v->phase == CLOSED) continue;
        if (v->frozen == 1 || happened[i].events & EPOLLERR) lose(v); /* a frozen one hears only of its end */
        else if (v->phase == CONNECTING) ask_upgrade(v);
        else read_from(v);
    }
}

static void freeze(int frozen) {
    for (int i = 0, left = o.frozen; i < o.viewers && left > 0; i += o.viewers / o.frozen, left--) {
        struct viewer *v = &viewers[i];
        if (v->phase != OPEN) continue;
        v->frozen = frozen ? 1 : 2; /* 2: reads again, still not counted among the healthy */
        struct epoll_event e = {.events = frozen ? EPOLLRDHUP : EPOLLIN, .data.ptr = v};
        epoll_ctl(epoll, EPOLL_CTL_MOD, v->fd, &e);
    }
}

struct cpu {
    double ran_s;  /* all threads of the server; softirq in its context is included */
    double busy_s; /* its core, whoever had it: what goes beyond ran_s was a neighbour's */
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

static struct cpu server_cpu(void) {
    char path[300];
    struct cpu sum = {0, core_busy_s()};
    snprintf(path, sizeof path, "/proc/%d/task", o.server_pid);
    DIR *tasks = o.server_pid ? opendir(path) : NULL;
    for (struct dirent *d; tasks && (d = readdir(tasks));) {
        unsigned long long ran = 0;
        snprintf(path, sizeof path, "/proc/%d/task/%s/schedstat", o.server_pid, d->d_name);
        FILE *f = d->d_name[0] == '.' ? NULL : fopen(path, "r");
        if (!f) continue;
        if (fscanf(f, "%llu", &ran) == 1) sum.ran_s += (double)ran * 1e-9;
        fclose(f);
    }
    if (tasks) closedir(tasks);
    return sum;
}

static double server_rss_mb(void) {
    char path[64];
    long size = 0, resident = 0;
    snprintf(path, sizeof path, "/proc/%d/statm", o.server_pid);
    FILE *f = o.server_pid ? fopen(path, "r") : NULL;
    if (f) {
        if (fscanf(f, "%ld %ld", &size, &resident) != 2) resident = 0;
        fclose(f);
    }
    return (double)resident * (double)sysconf(_SC_PAGESIZE) / 1e6;
}

static double own_cpu_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static double jain(void) {
    double sum = 0, squares = 0, n = 0;
    for (int i = 0; i < o.viewers; i++) {
        if (viewers[i].frozen || viewers[i].phase != OPEN) continue;
        sum += viewers[i].in_window;
        squares += (double)viewers[i].in_window * viewers[i].in_window;
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
    printf("\"frozen\":{\"count\":%d,\"gone\":%d,\"last_gone_s\":%.2f,\"backlog_s\":%.2f},", o.frozen, gone, last, seen.backlog_s);
}

static void read_options(int argc, char **argv) {
    for (int i = 1; i + 1 < argc; i += 2) {
        const char *name = argv[i], *value = argv[i + 1];
        if (!strcmp(name, "--host")) o.host = value;
        else if (!strcmp(name, "--port")) o.port = atoi(value);
        else if (!strcmp(name, "--path")) o.path = value;
        else if (!strcmp(name, "--mode")) o.mode = value;
        else if (!strcmp(name, "--stamps")) o.stamps = value;
        else if (!strcmp(name, "--viewers")) o.viewers = atoi(value);
        else if (!strcmp(name, "--seconds")) o.seconds = atof(value);
        else if (!strcmp(name, "--settle")) o.settle = atof(value);
        else if (!strcmp(name, "--in-flight")) o.in_flight = atoi(value);
        else if (!strcmp(name, "--sources")) o.sources = atoi(value);
        else if (!strcmp(name, "--step")) o.step = atoi(value);
        else if (!strcmp(name, "--server-pid")) o.server_pid = atoi(value);
        else if (!strcmp(name, "--server-core")) o.server_core = atoi(value);
        else if (!strcmp(name, "--frozen")) o.frozen = atoi(value);
        else if (!strcmp(name, "--resume-after")) o.resume_after = atof(value);
        else if (!strcmp(name, "--subprotocol")) o.subprotocol = value;
        else if (!strcmp(name, "--greet")) o.greet = value;
        else if (!strcmp(name, "--skip")) o.skip = atoi(value);
        else if (!strcmp(name, "--acks")) o.acks = atoi(value);
        else fprintf(stderr, "viewers: unknown option %s\n", name), exit(2);
    }
    if (o.greet && (strlen(o.greet) > 125 || (strncmp(o.greet, "text:", 5) && strncmp(o.greet, "hex:", 4)))) {
        fprintf(stderr, "viewers: --greet text:… or hex:…, at most 125 characters\n");
        exit(2);
    }
    if (o.port <= 0 || o.viewers <= 0 || !o.stamps || o.step < 1 || o.sources < 1 || o.frozen > o.viewers / 2) {
        fprintf(stderr, "usage: viewers --port P --path PATH --viewers N --stamps FILE …\n");
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
    stamps = open_stamps(o.stamps);
    viewers = calloc((size_t)o.viewers, sizeof *viewers);
    epoll = epoll_create1(0);

    int storm = !strcmp(o.mode, "storm");
    struct cpu before = server_cpu();
    double idle_rss = server_rss_mb(), own = own_cpu_s();
    uint64_t connect_began = now_ns();
    window_began = connect_began;
    measuring = storm;
    for (int next = 0; opened + failed < o.viewers && s_since(connect_began) < GIVE_UP_S;) {
        while (next < o.viewers && (storm || waiting < o.in_flight)) start(&viewers[next], next), next++;
        poll_once(100);
    }
    double connect_s = (double)(last_opened_ns - connect_began) * 1e-9;
    uint64_t settled = now_ns();
    stamps[ALL_CONNECTED] = !storm;
    while (s_since(settled) < (storm ? 1.0 : o.settle)) poll_once(20);

    double full_rss = server_rss_mb();
    if (!storm) {
        before = server_cpu(), own = own_cpu_s();
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
    struct cpu after = server_cpu();
    own = own_cpu_s() - own;

    printf("{\"viewers\":%d,\"opened\":%d,\"failed\":%d,\"connect_s\":%.4f,\"handshakes_per_s\":%.1f,", o.viewers, opened,
           o.viewers - opened, connect_s, connect_s > 0 ? opened / connect_s : 0);
    printf("\"handshake_ms\":{\"p50\":%.2f,\"p99\":%.2f,\"max\":%.2f},", histogram_ms(&handshake, .5),
           histogram_ms(&handshake, .99), (double)handshake.max_us / 1000);
    printf("\"window_began_s\":%.6f,\"wall_s\":%.4f,\"messages\":%lu,\"along\":%lu,\"bytes\":%lu,\"received\":%lu,\"texts\":%lu,\"keys\":%lu,\"acks\":%lu,",
           (double)window_began * 1e-9, wall, seen.frames, seen.along, seen.bytes, seen.received, seen.texts, seen.keys, seen.acks);
    printf("\"duplicates\":%lu,\"reordered\":%lu,\"missed\":%lu,\"orphans\":%lu,\"unreadable\":%lu,\"unstamped\":%lu,\"closed\":%lu,",
           seen.duplicates, seen.reordered, seen.missed, seen.orphans, seen.unreadable, seen.unstamped, seen.closed);
    printf("\"lateness_ms\":{\"p50\":%.2f,\"p99\":%.2f,\"p999\":%.2f,\"max\":%.2f},", histogram_ms(&lateness, .5),
           histogram_ms(&lateness, .99), histogram_ms(&lateness, .999), (double)lateness.max_us / 1000);
    if (o.frozen) report_frozen();
    printf("\"closings\":{");
    for (int i = 0, first = 1; i < 5000; i++)
        if (closings[i]) printf("%s\"%d\":%u", first ? "" : ",", i, closings[i]), first = 0;
    printf("},\"jain\":%.5f,\"generator_share\":%.3f,\"server_cpu_s\":%.4f,\"core_busy_s\":%.4f,", jain(), own / wall,
           after.ran_s - before.ran_s, after.busy_s - before.busy_s);
    printf("\"rss_mb\":{\"idle\":%.2f,\"connected\":%.2f,\"end\":%.2f}}\n", idle_rss, full_rss, server_rss_mb());
    return opened == o.viewers ? 0 : 1;
}
