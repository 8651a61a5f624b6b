/* The floor: one send() per viewer per frame, nothing else. What any server pays the kernel, without its own thoughts.
 *
 *   bare_server --hz R [--bytes 200] --stamps FILE      prints "PORT n", runs until SIGTERM
 *
 * The upgrade is answered for one well-known key only (RFC 6455's example, the one `viewers` sends), so no SHA-1 here.
 * What viewers send is read and thrown away. A tick that comes late is made at once and the schedule starts anew from it:
 * when the machine can't keep the rate the loop saturates. A socket that is full misses that frame. */
#define _GNU_SOURCE
#include "stamps.h"
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>

#define MAX_FD 65536
#define KEY_HEADER 17 /* wire format 1: tag, schema id u32, seq u32, t f64 */

static const char ANSWER[] = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                             "Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n\r\n";

static int viewers[MAX_FD], viewer_count;
static int place[MAX_FD]; /* fd → 1 + index in viewers; 0 while it has not upgraded */
static char asked[MAX_FD]; /* how many bytes of the blank line that ends the request have been seen */

static void forget(int fd) {
    if (place[fd]) {
        int last = viewers[--viewer_count];
        viewers[place[fd] - 1] = last;
        place[last] = place[fd];
        place[fd] = 0;
    }
    close(fd);
}

static void read_from(int fd) {
    static char heard[65536];
    ssize_t n = recv(fd, heard, sizeof heard, MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EAGAIN)) {
        forget(fd);
        return;
    }
    if (place[fd]) return;
    for (ssize_t i = 0; i < n; i++) {
        asked[fd] = heard[i] == "\r\n\r\n"[(int)asked[fd]] ? asked[fd] + 1 : heard[i] == '\r';
        if (asked[fd] == 4) {
            if (send(fd, ANSWER, sizeof ANSWER - 1, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)(sizeof ANSWER - 1)) {
                forget(fd);
                return;
            }
            viewers[viewer_count++] = fd;
            place[fd] = viewer_count;
            return;
        }
    }
}

static void take_all(int listener, int epoll) {
    for (;;) {
        int fd = accept4(listener, NULL, NULL, SOCK_NONBLOCK);
        if (fd < 0) return;
        int on = 1;
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
        place[fd] = asked[fd] = 0;
        struct epoll_event e = {.events = EPOLLIN, .data.fd = fd};
        epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &e);
    }
}

static size_t make_frame(uint8_t *out, uint32_t bytes, uint32_t seq) {
    size_t head = bytes < 126 ? 2 : 4;
    out[0] = 0x82;
    out[1] = bytes < 126 ? (uint8_t)bytes : 126;
    if (head == 4) out[2] = (uint8_t)(bytes >> 8), out[3] = (uint8_t)bytes;
    double t = (double)now_ns() * 1e-9;
    out[head] = 0x13;
    memset(out + head + 1, 0, 4);
    memcpy(out + head + 5, &seq, 4);
    memcpy(out + head + 9, &t, 8);
    for (uint32_t i = KEY_HEADER; i < bytes; i++) out[head + i] = (uint8_t)(i * 37 + seq);
    return head + bytes;
}

static void tick(uint32_t bytes, uint32_t seq, uint64_t *stamps) {
    static uint8_t frame[65536 + 4];
    stamps[seq % STAMP_SLOTS] = now_ns();
    size_t size = make_frame(frame, bytes, seq);
    for (int i = viewer_count - 1; i >= 0; i--) {
        ssize_t n = send(viewers[i], frame, size, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n == (ssize_t)size || (n < 0 && errno == EAGAIN)) continue;
        forget(viewers[i]); /* a torn frame can't be mended without a buffer, and this server has none */
    }
}

int main(int argc, char **argv) {
    double hz = 30;
    uint32_t bytes = 200;
    const char *path = NULL;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--hz")) hz = atof(argv[i + 1]);
        if (!strcmp(argv[i], "--bytes")) bytes = (uint32_t)atoi(argv[i + 1]);
        if (!strcmp(argv[i], "--stamps")) path = argv[i + 1];
    }
    if (!path || hz <= 0 || bytes < KEY_HEADER || bytes > 65535) {
        fprintf(stderr, "usage: bare_server --hz R [--bytes 17..65535] --stamps FILE\n");
        return 2;
    }
    struct rlimit files;
    getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max < MAX_FD ? files.rlim_max : MAX_FD;
    setrlimit(RLIMIT_NOFILE, &files);
    uint64_t *stamps = open_stamps(path);
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0), epoll = epoll_create1(0);
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof at;
    if (bind(listener, (struct sockaddr *)&at, sizeof at) || listen(listener, 4096)) {
        perror("bare_server: listen");
        return 1;
    }
    getsockname(listener, (struct sockaddr *)&at, &length);
    struct epoll_event e = {.events = EPOLLIN, .data.fd = listener}, happened[256];
    epoll_ctl(epoll, EPOLL_CTL_ADD, listener, &e);
    printf("PORT %d\n", ntohs(at.sin_port));
    fflush(stdout);

    uint64_t due = now_ns();
    for (uint32_t seq = 1;;) {
        int64_t left_ms = ((int64_t)(due - now_ns()) + 999999) / 1000000;
        int n = epoll_wait(epoll, happened, 256, left_ms > 0 ? (int)left_ms : 0);
        for (int i = 0; i < n; i++) {
            if (happened[i].data.fd == listener) take_all(listener, epoll);
            else read_from(happened[i].data.fd);
        }
        uint64_t now = now_ns();
        if (now < due) continue;
        tick(bytes, seq++, stamps);
        uint64_t period = (uint64_t)(stamps[ALL_CONNECTED] ? 1e9 / hz : 1e9);
        due = due + period > now ? due + period : now;
    }
}
