/* A specimen that speaks the Gusset wire protocol (tools/PROTOCOL.md) over UDP, complete, in one file.
 *
 * It is a spring: replace measure() by your rig. One axis called "axis 1", metres and newtons, no key, little-endian machine.
 * The layout hash is SHA-256 of the layout text; it is a constant as long as the axes are:
 *     printf 'gusset frames 1 axes 1 history 4\naxis 1|m|N\n' | sha256sum
 *
 *     cc -O2 -Wall -o specimen specimen.c -lm && ./specimen PORT [STIFFNESS_N_PER_M]
 */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

enum { COMMAND = 1, MEASUREMENT = 2, HEARTBEAT = 3, HOLD = 4, RETIRE = 5, GOODBYE = 6, CONTROL = 16 };
enum { HELLO = 0, WELCOME = 1, REFUSE = 2, ARM = 3, BYE = 4 };
enum { MESSAGE = 64000, LARGEST = 32 + MESSAGE + 4 };   /* of a control message, of a frame without a key */
#define NONE UINT64_MAX                                 /* no command has this number */

static const uint8_t LAYOUT[32] = {
    0x93, 0x27, 0xe9, 0xa7, 0x18, 0x2d, 0x41, 0xde, 0xdf, 0xf4, 0x3c, 0x73, 0xaa, 0x99, 0x3b, 0x78,
    0xab, 0x50, 0xa1, 0x5d, 0x6a, 0x9f, 0xd3, 0x10, 0xe2, 0x38, 0xa4, 0x8e, 0xda, 0x2a, 0xeb, 0xea
};

static int sock, armed, over, paused;                   /* over: the session has ended; a further retire is answered again */
static struct sockaddr_in peer, sender;
static uint64_t session, sent, newest_counter, seen;    /* seen: the 64 counters up to the newest, as bits */
static uint64_t sequence = NONE, expected;              /* the command in force, the lowest that may come next */
static struct { uint64_t sequence; double force; } past[5];             /* measurements, newest first */
static double stiffness = 4e5, disp, force;
static double watchdog, received_at, reported_at;       /* times of the last good frame, of the last report of a hold */
static double lowest, highest, largest_step, largest_force, period;   /* limits of the controller */
static double moved;                                    /* arrival of the command in force */
static uint32_t status, missed, tripped;
static uint8_t in[LARGEST + 1], out[LARGEST], hello[MESSAGE];
static size_t hello_length;

static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }

static void measure(void) { force = stiffness * disp; }   /* your rig */

static uint32_t crc32(const uint8_t *p, size_t n)
{
    uint32_t crc = 0xFFFFFFFFu;
    while (n--) {
        crc ^= *p++;
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (0xEDB88320u & -(crc & 1));
    }
    return ~crc;
}

static size_t put(size_t at, const void *value, size_t size) { memcpy(out + at, value, size); return at + size; }
static size_t put_u16(size_t at, uint16_t v) { return put(at, &v, 2); }
static size_t put_u32(size_t at, uint32_t v) { return put(at, &v, 4); }
static size_t put_u64(size_t at, uint64_t v) { return put(at, &v, 8); }
static size_t put_f64(size_t at, double v) { return put(at, &v, 8); }
static size_t put_text(size_t at, const char *t) { return put(put_u64(at, strlen(t)), t, strlen(t)); }

static uint16_t u16(size_t at) { uint16_t v; memcpy(&v, in + at, 2); return v; }
static uint32_t u32(size_t at) { uint32_t v; memcpy(&v, in + at, 4); return v; }
static uint64_t u64(size_t at) { uint64_t v; memcpy(&v, in + at, 8); return v; }
static double f64(size_t at) { double v; memcpy(&v, in + at, 8); return v; }

/* The body begins at offset 32 and ends at `end`; `of` is the session number of the frame. */
static void send_frame(int kind, size_t end, uint64_t of, const struct sockaddr_in *to)
{
    static uint64_t greetings;
    uint64_t counter = of ? ++sent : ++greetings;
    put(0, "GUST\1", 5);
    out[5] = (uint8_t)kind;
    put_u16(6, 2);
    put_u32(8, (uint32_t)end + 4);
    put_u16(12, kind == MEASUREMENT);
    put_u16(14, 0);
    put_u64(16, of);
    put_u64(24, counter);
    end = put_u32(end, crc32(out, end));
    sendto(sock, out, end, 0, (const struct sockaddr *)to, sizeof *to);
}

static void refuse(uint32_t code, const char *text, uint64_t of)
{
    size_t at = put_u32(32, REFUSE);
    at = put_u16(put_u16(put_u32(at, code), 1), 1);
    send_frame(CONTROL, put_text(at, text), of, &sender);
}

static void random_bytes(void *to, size_t size)
{
    FILE *f = fopen("/dev/urandom", "rb");
    if (!f || fread(to, 1, size, f) != size) exit(1);
    fclose(f);
}

static void notice(int kind, uint32_t cause)
{
    send_frame(kind, put_u32(put_u32(put_u64(32, sequence == NONE ? 0 : sequence), cause), 0), session, &peer);
}

static void heartbeat(void)
{
    size_t at = put_f64(put_u64(32, sequence == NONE ? 0 : sequence), now());
    send_frame(HEARTBEAT, put_u32(put_u32(at, status), 0), session, &peer);
}

/* Reads the controller's limits of the only axis; 0 if they are not valid. */
static int announced(size_t end)
{
    size_t at = 32 + 133;
    for (int text = 0; text < 2; text++) {
        if (end - at < 8 || u64(at) > end - at - 8) return 0;
        at += 8 + u64(at);
    }
    if (end - at < 16 || u64(at) != 1 || u64(at + 8) > end - at - 16) return 0;
    at += 16 + u64(at + 8) + 8;
    if (at + 32 != end || !u64(32 + 105) || !u64(32 + 113)) return 0;
    if (!(f64(at) < f64(at + 8) && f64(at + 16) > 0 && f64(at + 24) > 0)) return 0;
    lowest = f64(at);
    highest = f64(at + 8);
    double slack = isfinite(highest - lowest) ? 1e-9 * (highest - lowest) : 0;
    lowest -= slack;
    highest += slack;
    period = (double)u64(32 + 113) / (double)u64(32 + 105);
    largest_step = f64(at + 16) * period * (1 + 1e-9);
    largest_force = 1.25 * f64(at + 24);                 /* the controller judges forces first */
    return 1;
}

/* The same Hello gets the same Welcome again. Another begins a new session, but never while a test runs. */
static void welcome(size_t end, int ours)
{
    static uint8_t nonce[32];
    static const uint8_t zeros[32];
    static double stands;
    int again = ours && !over && hello_length == end - 32 && !memcmp(hello, in + 32, hello_length);
    if (!again) {
        if (armed) { refuse(8, "another controller is connected", 0); return; }
        if (end < 32 + 149) { refuse(12, "a hello is longer", 0); return; }
        if (u16(132) > 1 || u16(134) < 1) { refuse(0, "version 1 is spoken here", 0); return; }
        if (in[136]) { refuse(9, "no key is configured here", 0); return; }
        if (memcmp(in + 100, LAYOUT, 32)) { refuse(3, "one axis called 'axis 1' in m and N is wanted", 0); return; }
        if (!(f64(153) > 0 && f64(153) <= 60)) { refuse(6, "a watchdog time up to 60 s is wanted", 0); return; }
        if (u32(161) != 0) { refuse(7, "sampled when the command comes, not later", 0); return; }
        if (!announced(end)) { refuse(12, "a rate and one axis with limits that make sense are wanted", 0); return; }
        hello_length = end - 32;
        memcpy(hello, in + 32, hello_length);
        random_bytes(nonce, sizeof nonce);
        random_bytes(&session, sizeof session);
        if (!session) session = 1;
        peer = sender;
        watchdog = f64(153);
        stands = disp;
        sent = newest_counter = seen = expected = 0;
        sequence = NONE;
        over = 0;
        status = missed = tripped = 0;
        for (int i = 0; i < 5; i++) { past[i].sequence = NONE; past[i].force = 0; }
    }
    size_t at = put_u32(32, WELCOME);
    at = put(put(put(at, zeros, 32), nonce, 32), LAYOUT, 32);
    at = put_u16(put_u64(at, session), 1);
    out[at++] = 0;
    at = put_u32(put_f64(put_u32(at, 1 + 16), watchdog), 0); /* capabilities: simulated, keeps its state */
    at = put_f64(put_u64(at, 1), stiffness);
    at = put_f64(put_u64(at, 1), stands);
    at = put_text(put_text(at, "specimen.c 1"), "spring");
    at = put_text(put_u64(at, 1), "axis 1");
    at = put_u32(put_u32(at, 0), 3);
    at = put_f64(put_f64(put_f64(put_f64(at, -INFINITY), INFINITY), INFINITY), INFINITY);
    send_frame(CONTROL, at, 0, &sender);
}

static void answer(double came)
{
    size_t at = put_f64(put_f64(put_u64(32, sequence), came), now() - came);
    at = put_f64(put_f64(put_u32(put_u32(at, status), missed), disp), force);
    for (int i = 1; i < 5; i++) at = put_f64(put_u64(at, past[i].sequence), past[i].force);
    send_frame(MEASUREMENT, at, session, &peer);
}

/* Handles the first Arm message, and a second one after the wiring check. */
static void arm(size_t length, double came)
{
    static uint8_t answered[36];
    if (!armed || length != 72 || memcmp(answered, in + 32, 36)) {       /* else our answer was lost: send it again */
        if (length != 72 || u64(36) != session || u64(52) != 1 || u64(44) == NONE) {
            armed = 0;
            refuse(12, "an arm message of another session, or not for one axis", session);
            return;
        }
        if (u64(44) < expected) return;                                  /* overtaken by a later message */
        if (!(fabs(f64(60) - disp) <= 1e-9 * fabs(disp))) {
            armed = 0;                                                   /* further commands do not count */
            refuse(11, "the first command is not where the specimen stands", session);
            return;
        }
        expected = u64(44);
        sequence = NONE;
        moved = came;
        armed = 1;
        paused = 0;
        memcpy(answered, in + 32, 36);
    }
    memcpy(out + 32, answered, 36);
    send_frame(CONTROL, 68, session, &peer);
}

static void command(double came)
{
    uint64_t number = u64(32);
    if (number != sequence && number < expected) return; /* overtaken by a later command, or older than the Arm message */
    paused = 0;
    if (number != sequence) {
        uint64_t gap = number - expected;
        /* Lost commands give this one more time, but no more than has really passed. */
        double steps = fmin((double)gap + 1, (came - moved) / period + 1), to = f64(56);
        if (!(to >= lowest && to <= highest) || fabs(to - disp) > largest_step * steps) tripped = 1;   /* stay here */
        if (!tripped) disp = to;
        missed = gap > UINT32_MAX - missed ? UINT32_MAX : missed + (uint32_t)gap;
        expected = number + 1;
        sequence = number;
        moved = came;
        measure();
        if (!(fabs(force) <= largest_force)) tripped = 1;    /* the next command finds the specimen holding */
        status = tripped;
        memmove(past + 1, past, 4 * sizeof *past);
        past[0].sequence = number;
        past[0].force = force;
    }
    answer(came);
}

/* Checks length, checksum, writer, key, axes and numbers; 0: drop the frame. */
static int right(size_t length)
{
    if (length < 36 || memcmp(in, "GUST\1", 5) || u32(8) != length) return 0;
    if (u16(6) != 0 || u16(14) != 0 || u32(length - 4) != crc32(in, length - 4)) return 0;
    switch (in[5]) {
    case COMMAND:
        if (length != 76 || u16(12) != 1 || u64(32) == NONE) return 0;
        for (size_t at = 40; at < 72; at += 8) if (!isfinite(f64(at))) return 0;
        break;
    case HEARTBEAT: if (length != 60 || u16(12)) return 0; break;
    case HOLD: case RETIRE: case GOODBYE: if (length != 52 || u16(12)) return 0; break;
    case CONTROL: if (length < 40 || length > LARGEST || u16(12)) return 0; break;
    default: return 0;
    }
    return 1;
}

static int fresh(uint64_t counter)
{
    if (counter > newest_counter) {
        uint64_t forward = counter - newest_counter;
        seen = forward < 64 ? seen << forward | 1 : 1;
        newest_counter = counter;
        return 1;
    }
    uint64_t behind = newest_counter - counter;
    if (counter == 0 || behind >= 64 || seen >> behind & 1) return 0;
    seen |= (uint64_t)1 << behind;
    return 1;
}

/* Handles a frame that passed the checks. */
static void take(size_t length, double came)
{
    int ours = sender.sin_port == peer.sin_port && sender.sin_addr.s_addr == peer.sin_addr.s_addr;
    if (u64(16) == 0) {
        if (in[5] == CONTROL && u32(32) == HELLO) welcome(length - 4, ours);
        return;
    }
    if (!ours || u64(16) != session || !fresh(u64(24))) return;
    received_at = came;
    switch (in[5]) {
    case COMMAND: if (armed) command(came); break;
    case HOLD: paused = 1; break;
    case RETIRE: armed = 0; over = 1; notice(GOODBYE, 0); break;
    case GOODBYE: armed = 0; over = 1; break;
    case CONTROL:
        if (u32(32) == BYE) { armed = 0; over = 1; }
        if (u32(32) == ARM && !over) arm(length, came);
        break;
    }
}

/* Time counts from the last good frame; other senders and broken frames do not reset it. */
static void watch(double at)
{
    if (at - received_at > fmax(30, 10 * watchdog)) {          /* the controller is gone */
        armed = 0;
        over = 1;
        notice(GOODBYE, 3);
    } else if (!paused && at - fmax(received_at, reported_at) >= watchdog) {
        reported_at = at;
        status = tripped | 2;                            /* holding: stop the rig here */
        heartbeat();
    }
}

int main(int argc, char **argv)
{
    struct sockaddr_in here = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    socklen_t size = sizeof here;
    here.sin_port = htons((uint16_t)(argc > 1 ? atoi(argv[1]) : 0));
    if (argc > 2) stiffness = atof(argv[2]);
    sock = socket(AF_INET, SOCK_DGRAM, 0);
    if (sock < 0 || bind(sock, (struct sockaddr *)&here, size) || getsockname(sock, (struct sockaddr *)&here, &size)) {
        perror("specimen");
        return 1;
    }
    printf("listening on 127.0.0.1:%d\n", ntohs(here.sin_port));
    fflush(stdout);
    for (;;) {
        double left = armed && !paused ? fmax(received_at, reported_at) + watchdog - now() : 1;
        left = fmin(fmax(left, 1e-6), 1);
        struct timeval wait = { (time_t)left, left < 1 ? (suseconds_t)(1e6 * left) : 0 };
        setsockopt(sock, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
        socklen_t sender_size = sizeof sender;
        ssize_t length = recvfrom(sock, in, sizeof in, 0, (struct sockaddr *)&sender, &sender_size);
        if (length > 0 && right((size_t)length)) take((size_t)length, now());
        if (armed) watch(now());
    }
}
