/* Connections of many viewers of one machine: each from one of many loopback addresses, so that neither ports nor a cap
 * per address run out. Include it after _GNU_SOURCE. */
#ifndef POSECAST_LOOPBACK_H
#define POSECAST_LOOPBACK_H
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>

/* A socket that is not connected yet; without one the program, `name`, ends. */
static int open_socket(const char *name) {
    int on = 1, fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
    struct linger reset = {1, 0}; /* leave no TIME_WAIT behind: thousands of ports are needed again at once */
    if (fd < 0) {
        fprintf(stderr, "%s: ", name);
        perror("socket");
        exit(1);
    }
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(fd, IPPROTO_IP, IP_BIND_ADDRESS_NO_PORT, &on, sizeof on);
    setsockopt(fd, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    return fd;
}

/* Begins to connect from the loopback address number `source`; whether that is under way. */
static int begin_connect(int fd, const char *host, int port, int source) {
    struct sockaddr_in from = {.sin_family = AF_INET}, to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    from.sin_addr.s_addr = htonl(0x7f010001u + (uint32_t)(source / 200) * 256 + (uint32_t)(source % 200));
    inet_pton(AF_INET, host, &to.sin_addr);
    return !bind(fd, (struct sockaddr *)&from, sizeof from) &&
           (!connect(fd, (struct sockaddr *)&to, sizeof to) || errno == EINPROGRESS);
}

#endif
