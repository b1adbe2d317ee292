/* The board on a CAN interface of Linux in real time. Its valves fill two small closed volumes. */
#define _DEFAULT_SOURCE
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "host.h"

#define TURN_NS 500000L
#define SUPPLY 600000 /* Pa gauge */
#define AMBIENT 101325
#define FILL_TIME 0.5  /* s, time constant with a fully open valve */
#define VENT_TIME 0.1

struct can_board {
    int socket;
    double pressure[PAM_CHANNELS]; /* Pa gauge */
    uint32_t moved_at;
    struct pam_outputs outputs;
};

static uint32_t time_us(void *context)
{
    struct timespec now;

    (void)context;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)((uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u);
}

static bool receive(void *context, struct pam_frame *frame)
{
    const struct can_board *self = context;
    struct can_frame found;

    for (;;) {
        const ssize_t size = recv(self->socket, &found, sizeof found, MSG_DONTWAIT);

        if (size != (ssize_t)sizeof found) {
            return false;
        }
        if ((found.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) == 0) {
            break;
        }
    }
    frame->identifier = (uint16_t)(found.can_id & CAN_SFF_MASK);
    frame->length = found.can_dlc;
    memcpy(frame->data, found.data, sizeof frame->data);
    return true;
}

static bool send_frame(void *context, const struct pam_frame *frame)
{
    const struct can_board *self = context;
    struct can_frame out;

    memset(&out, 0, sizeof out);
    out.can_id = frame->identifier;
    out.can_dlc = frame->length;
    memcpy(out.data, frame->data, sizeof frame->data);
    return send(self->socket, &out, sizeof out, MSG_DONTWAIT) == (ssize_t)sizeof out;
}

static void move_air(struct can_board *self)
{
    const uint32_t now = time_us(self);
    const double step = 1e-6 * (now - self->moved_at);

    self->moved_at = now;
    for (int channel = 0; channel < PAM_CHANNELS; channel++) {
        const double opening =
            self->outputs.vents[channel] ? -1.0 : self->outputs.valve[channel] / 32767.0;
        const double target = opening > 0.0 ? SUPPLY : 0.0;
        const double rate = opening > 0.0 ? opening / FILL_TIME : -opening / VENT_TIME;
        const double share = rate * step < 1.0 ? rate * step : 1.0;

        self->pressure[channel] += (target - self->pressure[channel]) * share;
    }
}

static void read_sensors(void *context, struct pam_readings *readings)
{
    struct can_board *self = context;

    move_air(self);
    memset(readings, 0, sizeof *readings);
    for (int channel = 0; channel < PAM_CHANNELS; channel++) {
        readings->pressure[channel] = (int32_t)self->pressure[channel];
        readings->pressure_valid[channel] = true;
    }
    readings->angle_valid = true;
    readings->supply = SUPPLY + AMBIENT;
    readings->supply_valid = true;
    readings->emergency_stop = PAM_NO_INPUT;
    readings->enabling_switch = PAM_NO_INPUT;
    readings->self_test_passed = true;
}

static void write_outputs(void *context, const struct pam_outputs *outputs)
{
    struct can_board *self = context;

    move_air(self);
    self->outputs = *outputs;
}

static void feed_watchdog(void *context)
{
    (void)context;
}

static int open_interface(const char *name)
{
    struct ifreq request;
    struct sockaddr_can address;
    const int opened = socket(PF_CAN, SOCK_RAW, CAN_RAW);

    memset(&request, 0, sizeof request);
    memset(&address, 0, sizeof address);
    if (opened < 0 || strlen(name) >= sizeof request.ifr_name) {
        return -1;
    }
    memcpy(request.ifr_name, name, strlen(name));
    address.can_family = AF_CAN;
    if (ioctl(opened, SIOCGIFINDEX, &request) < 0) {
        close(opened);
        return -1;
    }
    address.can_ifindex = request.ifr_ifindex;
    if (bind(opened, (struct sockaddr *)&address, sizeof address) < 0) {
        close(opened);
        return -1;
    }
    return opened;
}

int run_on_socketcan(const struct pam_settings *settings, const char *interface)
{
    static struct can_board self;
    static struct pam_board board;
    const struct pam_hardware hardware = {
        &self, time_us, receive, send_frame, read_sensors, write_outputs, feed_watchdog,
    };
    const struct timespec turn = {0, TURN_NS};

    self.socket = open_interface(interface);
    if (self.socket < 0) {
        fprintf(stderr, "pam_board: cannot open %s: %s\n", interface, strerror(errno));
        return 2;
    }
    self.moved_at = time_us(&self);
    self.outputs.vents[0] = self.outputs.vents[1] = true;
    pam_board_init(&board, &hardware, settings);
    for (;;) {
        pam_board_step(&board);
        nanosleep(&turn, NULL);
    }
}
