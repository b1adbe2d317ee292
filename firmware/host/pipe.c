/* The board behind a pipe: whoever holds the other end is its bus, its sensors and its clock.
 *
 * A request has 40 bytes, little-endian: kind (1 a frame, 0 none), length and identifier of the frame,
 * its 8 bytes, the time [us], two pressures [Pa gauge], angle [microradian], supply [Pa absolute], what
 * is valid (bits 0, 1 pressures, 2 angle, 3 supply), emergency stop, enabling switch, self test passed,
 * defects, 2 bytes that are not used. The answer: number of frames, state, outputs (bits 0, 1 a valve
 * vents, 2 brake, 3 dump valve), one byte that is not used, faults, rejected frames, two valves, and
 * each frame with identifier, length, one byte that is not used and 8 bytes.
 */
#include <stdio.h>
#include <string.h>

#include "host.h"

#define REQUEST 40
#define ANSWER 12
#define FRAME 12
#define MOST_FRAMES 8

struct pipe_board {
    uint32_t now;
    bool has_frame;
    struct pam_frame frame;
    struct pam_readings readings;
    struct pam_outputs outputs;
    uint8_t sent[MOST_FRAMES * FRAME];
    size_t sent_count;
};

static uint32_t number_at(const uint8_t *from, int bytes)
{
    uint32_t value = 0;

    for (int place = bytes - 1; place >= 0; place--) {
        value = value << 8 | from[place];
    }
    return value;
}

static void put(uint8_t *to, uint32_t value)
{
    to[0] = (uint8_t)(value & 0xFFu);
    to[1] = (uint8_t)(value >> 8 & 0xFFu);
}

static uint32_t time_us(void *context)
{
    return ((struct pipe_board *)context)->now;
}

static bool receive(void *context, struct pam_frame *frame)
{
    struct pipe_board *self = context;
    const bool had = self->has_frame;

    if (had) {
        *frame = self->frame;
        self->has_frame = false;
    }
    return had;
}

static bool send(void *context, const struct pam_frame *frame)
{
    struct pipe_board *self = context;

    if (self->sent_count == MOST_FRAMES) {
        return false;
    }
    uint8_t *to = self->sent + FRAME * self->sent_count++;
    put(to, frame->identifier);
    to[2] = frame->length;
    to[3] = 0;
    memcpy(to + 4, frame->data, sizeof frame->data);
    return true;
}

static void read_sensors(void *context, struct pam_readings *readings)
{
    *readings = ((struct pipe_board *)context)->readings;
}

static void write_outputs(void *context, const struct pam_outputs *outputs)
{
    ((struct pipe_board *)context)->outputs = *outputs;
}

static void feed_watchdog(void *context)
{
    (void)context;
}

static void take(struct pipe_board *self, const uint8_t *request)
{
    struct pam_readings *read = &self->readings;

    self->has_frame = request[0] != 0;
    self->frame.length = request[1];
    self->frame.identifier = (uint16_t)number_at(request + 2, 2);
    memcpy(self->frame.data, request + 4, sizeof self->frame.data);
    self->now = number_at(request + 12, 4);
    read->pressure[0] = (int32_t)number_at(request + 16, 4);
    read->pressure[1] = (int32_t)number_at(request + 20, 4);
    read->angle = (int32_t)number_at(request + 24, 4);
    read->supply = (int32_t)number_at(request + 28, 4);
    read->pressure_valid[0] = (request[32] & 1u) != 0;
    read->pressure_valid[1] = (request[32] & 2u) != 0;
    read->angle_valid = (request[32] & 4u) != 0;
    read->supply_valid = (request[32] & 8u) != 0;
    read->emergency_stop = (enum pam_input)(request[33] & 3u);
    read->enabling_switch = (enum pam_input)(request[34] & 3u);
    read->self_test_passed = request[35] != 0;
    read->defects = (uint16_t)number_at(request + 36, 2);
}

static bool answer(const struct pipe_board *self, const struct pam_board *board)
{
    uint8_t head[ANSWER] = {(uint8_t)self->sent_count, board->state, 0, 0};

    head[2] = (uint8_t)((self->outputs.vents[0] ? 1u : 0u) | (self->outputs.vents[1] ? 2u : 0u)
                        | (self->outputs.release_brake ? 4u : 0u)
                        | (self->outputs.close_dump ? 8u : 0u));
    put(head + 4, board->faults);
    put(head + 6, board->rejected_frames);
    put(head + 8, (uint16_t)self->outputs.valve[0]);
    put(head + 10, (uint16_t)self->outputs.valve[1]);
    return fwrite(head, sizeof head, 1, stdout) == 1
           && fwrite(self->sent, FRAME, self->sent_count, stdout) == self->sent_count
           && fflush(stdout) == 0;
}

int run_on_pipe(const struct pam_settings *settings)
{
    static struct pipe_board self;
    static struct pam_board board;
    const struct pam_hardware hardware = {
        &self, time_us, receive, send, read_sensors, write_outputs, feed_watchdog,
    };
    uint8_t request[REQUEST];
    bool begun = false;

    while (fread(request, sizeof request, 1, stdin) == 1) {
        take(&self, request);
        if (!begun) {
            pam_board_init(&board, &hardware, settings);
            begun = true;
        }
        self.sent_count = 0;
        pam_board_step(&board);
        if (!answer(&self, &board)) {
            return 1;
        }
    }
    return 0;
}
