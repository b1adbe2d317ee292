#include "pam_frames.h"

#include <string.h>

#define PROTOCOL_VERSION 2
#define PRESSURE_STEP 20       /* Pa */
#define PRESSURE_OFFSET 100000 /* Pa */
#define NOT_AVAILABLE 65535
#define LARGEST_RAW 65534
#define LARGEST_ANGLE 8388607 /* microradians */

/* By message, identifiers of board 0: on a bus of its own, and on one with CANopen devices
 * (IdWithCanopen in the DBC file, which cantools does not pass on; a test compares them). */
static const uint16_t OWN_BUS[] = {
    PAM_BOARD_DBC_BOARD_COMMAND_FRAME_ID, PAM_BOARD_DBC_VALVE_COMMAND_FRAME_ID,
    PAM_BOARD_DBC_MEASUREMENT_FRAME_ID, PAM_BOARD_DBC_STATUS_FRAME_ID,
    PAM_BOARD_DBC_HEARTBEAT_FRAME_ID,
};
static const uint16_t WITH_CANOPEN[] = {0x010, 0x020, 0x030, 0x040, 0x050};

uint8_t pam_crc8(uint16_t identifier, const uint8_t *data, uint8_t length)
{
    const uint8_t head[2] = {(uint8_t)(identifier & 0xFFu), (uint8_t)(identifier >> 8)};
    unsigned crc = 0xFFu;

    for (unsigned place = 0; place < 2u + length; place++) {
        crc ^= place < 2u ? head[place] : data[place - 2u];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc & 0x80u) ? ((crc << 1) ^ 0x1Du) & 0xFFu : (crc << 1) & 0xFFu;
        }
    }
    return (uint8_t)(crc ^ 0xFFu);
}

uint16_t pam_identifier(const struct pam_settings *settings, enum pam_message message)
{
    const uint16_t *first = settings->shares_with_canopen ? WITH_CANOPEN : OWN_BUS;

    return (uint16_t)(first[message] + settings->number);
}

static bool checksum_is_right(const struct pam_frame *frame)
{
    const uint8_t covered = (uint8_t)(frame->length - 1u);

    return pam_crc8(frame->identifier, frame->data, covered) == frame->data[covered];
}

static enum pam_verdict decode_valves(const struct pam_frame *frame,
                                      struct pam_board_dbc_valve_command_t *valves)
{
    if (frame->length != PAM_BOARD_DBC_VALVE_COMMAND_LENGTH) {
        return PAM_REJECTED;
    }
    if (!checksum_is_right(frame)) {
        return PAM_WRONG_CRC;
    }
    if (pam_board_dbc_valve_command_unpack(valves, frame->data, frame->length) < 0
        || !pam_board_dbc_valve_command_valve0_is_in_range(valves->valve0)
        || !pam_board_dbc_valve_command_valve1_is_in_range(valves->valve1)) {
        return PAM_REJECTED;
    }
    return PAM_VALID_VALVES;
}

static enum pam_verdict decode_code(const struct pam_frame *frame,
                                    struct pam_board_dbc_board_command_t *command)
{
    if (frame->length != PAM_BOARD_DBC_BOARD_COMMAND_LENGTH) {
        return PAM_REJECTED;
    }
    if (!checksum_is_right(frame)) {
        return PAM_WRONG_CRC;
    }
    if (pam_board_dbc_board_command_unpack(command, frame->data, frame->length) < 0
        || !pam_board_dbc_board_command_code_is_in_range(command->code)) {
        return PAM_REJECTED;
    }
    return PAM_VALID_CODE;
}

enum pam_verdict pam_decode(const struct pam_settings *settings, const struct pam_frame *frame,
                            union pam_command *command)
{
    if (frame->identifier == pam_identifier(settings, PAM_VALVE_COMMAND)) {
        return decode_valves(frame, &command->valves);
    }
    if (frame->identifier == pam_identifier(settings, PAM_BOARD_COMMAND)) {
        return decode_code(frame, &command->board);
    }
    return PAM_NOT_MINE;
}

static int32_t limited(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : value;
}

/* A pressure in steps from an offset, rounded; the ends of the range for what is beyond it. */
static uint16_t raw_pressure(int32_t pressure, int32_t offset)
{
    const int32_t above =
        limited(pressure, -offset, LARGEST_RAW * PRESSURE_STEP - offset) + offset;

    return (uint16_t)((above + PRESSURE_STEP / 2) / PRESSURE_STEP);
}

static void begin(const struct pam_board *board, enum pam_message message, struct pam_frame *frame)
{
    frame->identifier = pam_identifier(&board->settings, message);
    frame->length = sizeof frame->data;
}

void pam_encode_measurement(const struct pam_board *board, struct pam_frame *frame)
{
    const struct pam_readings *read = &board->readings;
    struct pam_board_dbc_measurement_t message;
    uint16_t raw[PAM_CHANNELS];

    for (int channel = 0; channel < PAM_CHANNELS; channel++) {
        raw[channel] = read->pressure_valid[channel]
                           ? raw_pressure(read->pressure[channel], PRESSURE_OFFSET)
                           : NOT_AVAILABLE;
    }
    message.pressure0 = raw[0];
    message.pressure1 = raw[1];
    message.position = read->angle_valid ? limited(read->angle, -LARGEST_ANGLE, LARGEST_ANGLE)
                                         : -LARGEST_ANGLE - 1;
    message.counter = board->samples;
    begin(board, PAM_MEASUREMENT, frame);
    (void)pam_board_dbc_measurement_pack(frame->data, &message, sizeof frame->data);
}

static uint8_t has(const struct pam_board *board, enum pam_fault fault)
{
    return (board->faults & (unsigned)fault) ? 1u : 0u;
}

void pam_encode_status(const struct pam_board *board, struct pam_frame *frame)
{
    const struct pam_readings *read = &board->readings;
    struct pam_board_dbc_status_t message;

    memset(&message, 0, sizeof message);
    message.state = board->state;
    message.fault_watchdog = has(board, PAM_FAULT_WATCHDOG);
    message.fault_crc = has(board, PAM_FAULT_CRC);
    message.fault_over_pressure = has(board, PAM_FAULT_OVER_PRESSURE);
    message.fault_sensor = has(board, PAM_FAULT_SENSOR);
    message.fault_supply = has(board, PAM_FAULT_SUPPLY);
    message.fault_valve = has(board, PAM_FAULT_VALVE);
    message.fault_temperature = has(board, PAM_FAULT_TEMPERATURE);
    message.fault_internal = has(board, PAM_FAULT_INTERNAL);
    message.fault_host = has(board, PAM_FAULT_HOST);
    message.fault_emergency_stop = has(board, PAM_FAULT_EMERGENCY_STOP);
    message.emergency_stop = (uint8_t)read->emergency_stop;
    message.enabling_switch = (uint8_t)read->enabling_switch;
    message.brake_released = board->outputs.release_brake ? 1u : 0u;
    message.dump_closed = board->outputs.close_dump ? 1u : 0u;
    message.command_counter = board->counter;
    message.supply_pressure = read->supply_valid ? raw_pressure(read->supply, 0) : NOT_AVAILABLE;
    message.rejected_frames = board->rejected_frames;
    begin(board, PAM_STATUS, frame);
    (void)pam_board_dbc_status_pack(frame->data, &message, sizeof frame->data);
}

void pam_encode_heartbeat(const struct pam_board *board, struct pam_frame *frame)
{
    struct pam_board_dbc_heartbeat_t message;

    message.uptime = (uint32_t)(board->uptime_us / 1000u);
    message.protocol_version = PROTOCOL_VERSION;
    message.firmware_version = board->settings.firmware_version;
    begin(board, PAM_HEARTBEAT, frame);
    (void)pam_board_dbc_heartbeat_pack(frame->data, &message, sizeof frame->data);
}
