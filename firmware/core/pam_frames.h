/* Frames to values and back, by the codec that cantools makes from the DBC file. */
#ifndef PAM_FRAMES_H
#define PAM_FRAMES_H

#include "pam_board.h"
#include "pam_board_dbc.h"

enum pam_verdict { PAM_NOT_MINE, PAM_VALID_VALVES, PAM_VALID_CODE, PAM_REJECTED, PAM_WRONG_CRC };

union pam_command {
    struct pam_board_dbc_valve_command_t valves;
    struct pam_board_dbc_board_command_t board;
};

enum pam_message { PAM_BOARD_COMMAND, PAM_VALVE_COMMAND, PAM_MEASUREMENT, PAM_STATUS, PAM_HEARTBEAT };

/* The identifier of a message of this board. */
uint16_t pam_identifier(const struct pam_settings *settings, enum pam_message message);

/* Checks length, checksum and ranges of a frame, in this order. */
enum pam_verdict pam_decode(const struct pam_settings *settings, const struct pam_frame *frame,
                            union pam_command *command);

void pam_encode_measurement(const struct pam_board *board, struct pam_frame *frame);
void pam_encode_status(const struct pam_board *board, struct pam_frame *frame);
void pam_encode_heartbeat(const struct pam_board *board, struct pam_frame *frame);

#endif
