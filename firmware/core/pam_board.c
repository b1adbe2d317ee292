#include "pam_board.h"

#include <string.h>

#include "pam_frames.h"

#define WATCHDOG_US 100000u  /* WatchdogTimeout of the DBC file; a test compares the two */
#define CRC_WINDOW_US 1000000u
#define MEASUREMENT_US (1000u * PAM_BOARD_DBC_MEASUREMENT_CYCLE_TIME_MS)
#define STATUS_US (1000u * PAM_BOARD_DBC_STATUS_CYCLE_TIME_MS)
#define HEARTBEAT_US (1000u * PAM_BOARD_DBC_HEARTBEAT_CYCLE_TIME_MS)
#define FRAMES_PER_STEP 32 /* a flooded bus must not keep the board from its other work */

#define CODE_VENT PAM_BOARD_DBC_BOARD_COMMAND_CODE_VENT_CHOICE
#define CODE_CLEAR_FAULTS PAM_BOARD_DBC_BOARD_COMMAND_CODE_CLEAR_FAULTS_CHOICE
#define CODE_LATCH_FAULT PAM_BOARD_DBC_BOARD_COMMAND_CODE_LATCH_FAULT_CHOICE

static void enter(struct pam_board *board, enum pam_state state)
{
    board->state = (uint8_t)state;
    board->state_inverted = (uint8_t)~board->state;
}

/* Leaves the valves vented and not armed. */
static void disarm(struct pam_board *board, enum pam_state state)
{
    enter(board, state);
    board->armed = false;
    for (int channel = 0; channel < PAM_CHANNELS; channel++) {
        board->enabled[channel] = false;
    }
}

static void fail(struct pam_board *board, uint16_t faults)
{
    board->faults |= faults;
    disarm(board, PAM_FAULT);
}

static bool is_enabled(const struct pam_board *board)
{
    return board->readings.enabling_switch == PAM_PERMITS
           || board->readings.enabling_switch == PAM_NO_INPUT;
}

static bool is_stopped(const struct pam_board *board)
{
    return board->readings.emergency_stop != PAM_PERMITS
           && board->readings.emergency_stop != PAM_NO_INPUT;
}

static void take_valves(struct pam_board *board, const struct pam_board_dbc_valve_command_t *command,
                        uint32_t now)
{
    if (board->has_counter && command->counter == board->counter) {
        return; /* an old frame, which is not wrong */
    }
    board->has_counter = true;
    board->counter = command->counter;
    board->accepted_at = now;
    board->valve[0] = command->valve0;
    board->valve[1] = command->valve1;
    board->enabled[0] = command->enable0 != 0u;
    board->enabled[1] = command->enable1 != 0u;
    board->wants_brake_released = command->release_brake != 0u;
    board->wants_dump_closed = command->close_dump != 0u;
    if (!board->enabled[0] && !board->enabled[1]) {
        board->armed = true;
        if (board->state == PAM_ACTIVE) {
            enter(board, PAM_VENTED);
        }
    } else if (board->state == PAM_VENTED && board->armed && is_enabled(board)) {
        enter(board, PAM_ACTIVE);
        board->crc_error_count = 0;
    }
}

static void clear_faults(struct pam_board *board)
{
    const bool cause_present = board->over_pressure || board->sensor_lost
                               || board->readings.defects != 0u || is_stopped(board);

    if (board->state == PAM_FAULT && !cause_present) {
        board->faults = 0;
        disarm(board, PAM_VENTED);
    }
}

static void take_code(struct pam_board *board, uint8_t code)
{
    if (code == CODE_VENT) {
        if (board->state == PAM_ACTIVE) {
            disarm(board, PAM_VENTED);
        }
        board->armed = false;
    } else if (code == CODE_CLEAR_FAULTS) {
        clear_faults(board);
    } else if (code == CODE_LATCH_FAULT) {
        if (board->state == PAM_BOOT) {
            board->faults |= PAM_FAULT_HOST; /* `fault` follows `boot` */
        } else {
            fail(board, PAM_FAULT_HOST);
        }
    }
}

static void count_crc_error(struct pam_board *board, uint32_t now)
{
    if (board->state != PAM_ACTIVE) {
        return;
    }
    board->crc_errors[board->crc_error_next] = now;
    board->crc_error_next = (uint8_t)((board->crc_error_next + 1u) % PAM_CRC_LIMIT);
    if (board->crc_error_count < PAM_CRC_LIMIT) {
        board->crc_error_count++;
    }
    /* the next place of the full ring has the oldest of the last PAM_CRC_LIMIT errors */
    if (board->crc_error_count == PAM_CRC_LIMIT
        && now - board->crc_errors[board->crc_error_next] < CRC_WINDOW_US) {
        fail(board, PAM_FAULT_CRC);
    }
}

static void receive(struct pam_board *board, uint32_t now)
{
    struct pam_frame frame;
    union pam_command command;

    for (int left = FRAMES_PER_STEP; left > 0; left--) {
        if (!board->hardware.receive(board->hardware.context, &frame)) {
            return;
        }
        if (frame.length > sizeof frame.data) {
            continue;
        }
        switch (pam_decode(&board->settings, &frame, &command)) {
        case PAM_VALID_VALVES:
            take_valves(board, &command.valves, now);
            break;
        case PAM_VALID_CODE:
            take_code(board, command.board.code);
            break;
        case PAM_WRONG_CRC:
            board->rejected_frames++;
            count_crc_error(board, now);
            break;
        case PAM_REJECTED:
            board->rejected_frames++;
            break;
        case PAM_NOT_MINE:
            break;
        }
    }
}

/* What the sensors and inputs say now. */
static uint16_t present_faults(struct pam_board *board)
{
    const struct pam_readings *read = &board->readings;
    uint16_t found = read->defects;

    board->over_pressure = false;
    board->sensor_lost = !read->angle_valid;
    for (int channel = 0; channel < PAM_CHANNELS; channel++) {
        board->sensor_lost = board->sensor_lost || !read->pressure_valid[channel];
        board->over_pressure =
            board->over_pressure
            || (read->pressure_valid[channel]
                && read->pressure[channel] > board->settings.max_pressure[channel]);
    }
    if (board->over_pressure) {
        found |= PAM_FAULT_OVER_PRESSURE;
    }
    if (board->sensor_lost) {
        found |= PAM_FAULT_SENSOR;
    }
    if (is_stopped(board)) {
        found |= PAM_FAULT_EMERGENCY_STOP;
    }
    return found;
}

static void judge(struct pam_board *board, uint32_t now)
{
    const uint16_t found = present_faults(board);

    if (board->state == PAM_BOOT) {
        if (board->uptime_us < board->settings.boot_us || !board->readings.self_test_passed) {
            return;
        }
        enter(board, board->faults != 0u ? PAM_FAULT : PAM_VENTED);
    }
    if (board->state == PAM_ACTIVE && now - board->accepted_at > WATCHDOG_US) {
        fail(board, PAM_FAULT_WATCHDOG);
    }
    if (found != 0u) {
        fail(board, found);
    }
    if (board->state == PAM_ACTIVE && !is_enabled(board)) {
        disarm(board, PAM_VENTED);
    }
}

static void set_outputs(struct pam_board *board)
{
    struct pam_outputs *outputs = &board->outputs;
    const bool active = board->state == PAM_ACTIVE;

    for (int channel = 0; channel < PAM_CHANNELS; channel++) {
        const bool follows = active && board->enabled[channel];

        outputs->vents[channel] = !follows;
        outputs->valve[channel] = follows ? board->valve[channel] : (int16_t)0;
    }
    outputs->release_brake = active && board->wants_brake_released;
    outputs->close_dump = active && board->wants_dump_closed;
    board->hardware.write(board->hardware.context, outputs);
}

/* Whether a frame is due. A late board sends one frame and no burst, and keeps its grid. */
static bool is_due(uint64_t *due, uint32_t period, uint64_t now)
{
    if (now < *due) {
        return false;
    }
    *due += period * ((now - *due) / period + 1u);
    return true;
}

static bool send(const struct pam_board *board, const struct pam_frame *frame)
{
    return board->hardware.send(board->hardware.context, frame);
}

static void send_what_is_due(struct pam_board *board)
{
    const uint64_t now = board->uptime_us;
    const uint8_t inputs = (uint8_t)((unsigned)board->readings.emergency_stop
                                     | (unsigned)board->readings.enabling_switch << 4);
    const bool news = !board->has_told || board->told_state != board->state
                      || board->told_faults != board->faults || board->told_inputs != inputs;
    struct pam_frame frame;

    if (is_due(&board->due_measurement, MEASUREMENT_US, now)) {
        board->samples++;
        pam_encode_measurement(board, &frame);
        (void)send(board, &frame); /* a measurement that cannot be sent now is soon old */
    }
    if (is_due(&board->due_status, STATUS_US, now) || news) {
        pam_encode_status(board, &frame);
        board->has_told = send(board, &frame); /* else again in the next turn */
        board->told_state = board->state;
        board->told_faults = board->faults;
        board->told_inputs = inputs;
    }
    if (is_due(&board->due_heartbeat, HEARTBEAT_US, now)) {
        pam_encode_heartbeat(board, &frame);
        (void)send(board, &frame);
    }
}

void pam_board_init(struct pam_board *board, const struct pam_hardware *hardware,
                    const struct pam_settings *settings)
{
    memset(board, 0, sizeof *board);
    board->hardware = *hardware;
    board->settings = *settings;
    disarm(board, PAM_BOOT);
    board->last_step = hardware->time_us(hardware->context);
    hardware->read(hardware->context, &board->readings);
    set_outputs(board);
}

void pam_board_step(struct pam_board *board)
{
    const uint32_t now = board->hardware.time_us(board->hardware.context);

    board->uptime_us += now - board->last_step;
    board->last_step = now;
    if ((board->state ^ board->state_inverted) != 0xFF) {
        fail(board, PAM_FAULT_INTERNAL);
    }
    receive(board, now);
    board->hardware.read(board->hardware.context, &board->readings);
    judge(board, now);
    set_outputs(board);
    send_what_is_due(board);
    board->hardware.feed_watchdog(board->hardware.context);
}
