/* Made from firmware/protocol.yaml by firmware/generate.py; change those. */
#include "protocol.h"

#include <stddef.h>

const field_t command_fields[] PROGMEM = {
    {offsetof(command_t, sequence), 6},
    {offsetof(command_t, left), FIELD_SIGNED | 15},
    {offsetof(command_t, right), FIELD_SIGNED | 15},
    {0, 0},
};

const field_t duty_fields[] PROGMEM = {
    {offsetof(duty_t, sequence), 6},
    {offsetof(duty_t, left), FIELD_SIGNED | 15},
    {offsetof(duty_t, right), FIELD_SIGNED | 15},
    {0, 0},
};

const field_t stop_fields[] PROGMEM = {
    {offsetof(stop_t, sequence), 6},
    {offsetof(stop_t, guard), 6},
    {0, 0},
};

const field_t ask_fields[] PROGMEM = {
    {offsetof(ask_t, version), 8},
    {offsetof(ask_t, guard), 4},
    {0, 0},
};

const field_t action_fields[] PROGMEM = {
    {offsetof(action_t, action), 4},
    {offsetof(action_t, value), 8},
    {0, 0},
};

const field_t settings_fields[] PROGMEM = {
    {offsetof(settings_t, left_enable), 8},
    {offsetof(settings_t, left_in1), 8},
    {offsetof(settings_t, left_in2), 8},
    {offsetof(settings_t, left_encoder), 8},
    {offsetof(settings_t, left_encoder_b), 8},
    {offsetof(settings_t, right_enable), 8},
    {offsetof(settings_t, right_in1), 8},
    {offsetof(settings_t, right_in2), 8},
    {offsetof(settings_t, right_encoder), 8},
    {offsetof(settings_t, right_encoder_b), 8},
    {offsetof(settings_t, range), 8},
    {offsetof(settings_t, battery), 8},
    {offsetof(settings_t, button), 8},
    {offsetof(settings_t, left_reversed), 1},
    {offsetof(settings_t, right_reversed), 1},
    {offsetof(settings_t, enable_inverted), 1},
    {offsetof(settings_t, brake), 1},
    {offsetof(settings_t, button_high), 1},
    {offsetof(settings_t, encoder_reversed_left), 1},
    {offsetof(settings_t, encoder_reversed_right), 1},
    {offsetof(settings_t, edge_times), 1},
    {offsetof(settings_t, edge), 2},
    {offsetof(settings_t, baud), 3},
    {offsetof(settings_t, reserved), 3},
    {offsetof(settings_t, slots), 16},
    {offsetof(settings_t, glitch), 16},
    {offsetof(settings_t, deadman), 16},
    {offsetof(settings_t, telemetry), 8},
    {offsetof(settings_t, left_start), 16},
    {offsetof(settings_t, right_start), 16},
    {offsetof(settings_t, left_gain), 16},
    {offsetof(settings_t, right_gain), 16},
    {offsetof(settings_t, proportional), 16},
    {offsetof(settings_t, integral), 16},
    {0, 0},
};

const field_t state_fields[] PROGMEM = {
    {offsetof(state_t, sequence), 6},
    {offsetof(state_t, boot), 4},
    {offsetof(state_t, mode), 3},
    {offsetof(state_t, dropped), 1},
    {offsetof(state_t, time), 16},
    {offsetof(state_t, left), 16},
    {offsetof(state_t, right), 16},
    {offsetof(state_t, range), 12},
    {offsetof(state_t, command), 6},
    {offsetof(state_t, command_age), 10},
    {offsetof(state_t, left_age), 16},
    {offsetof(state_t, right_age), 16},
    {offsetof(state_t, reserved), 2},
    {0, 0},
};

const field_t counts_fields[] PROGMEM = {
    {offsetof(counts_t, sequence), 6},
    {offsetof(counts_t, boot), 4},
    {offsetof(counts_t, mode), 3},
    {offsetof(counts_t, dropped), 1},
    {offsetof(counts_t, time), 16},
    {offsetof(counts_t, left), 16},
    {offsetof(counts_t, right), 16},
    {offsetof(counts_t, range), 12},
    {offsetof(counts_t, command), 6},
    {offsetof(counts_t, command_age), 10},
    {offsetof(counts_t, reserved), 2},
    {0, 0},
};

const field_t status_fields[] PROGMEM = {
    {offsetof(status_t, uptime), 24},
    {offsetof(status_t, reset), 4},
    {offsetof(status_t, stored), 1},
    {offsetof(status_t, button), 1},
    {offsetof(status_t, left_fault), 1},
    {offsetof(status_t, right_fault), 1},
    {offsetof(status_t, battery), 12},
    {offsetof(status_t, free_stack), 16},
    {offsetof(status_t, loop), 16},
    {offsetof(status_t, left_rejected), 16},
    {offsetof(status_t, right_rejected), 16},
    {offsetof(status_t, damaged), 16},
    {offsetof(status_t, foreign), 8},
    {offsetof(status_t, dropped), 8},
    {0, 0},
};

const field_t hello_fields[] PROGMEM = {
    {offsetof(hello_t, version), 8},
    {offsetof(hello_t, major), 8},
    {offsetof(hello_t, minor), 8},
    {offsetof(hello_t, patch), 8},
    {offsetof(hello_t, board), 8},
    {offsetof(hello_t, boot), 4},
    {offsetof(hello_t, reset), 4},
    {offsetof(hello_t, mode), 3},
    {offsetof(hello_t, uart), 1},
    {offsetof(hello_t, settings), 24},
    {0, 0},
};

const field_t answer_fields[] PROGMEM = {
    {offsetof(answer_t, refusal), 4},
    {offsetof(answer_t, field), 8},
    {offsetof(answer_t, settings), 24},
    {0, 0},
};

const field_t capture_fields[] PROGMEM = {
    {offsetof(capture_t, sequence), 6},
    {offsetof(capture_t, lost), 1},
    {offsetof(capture_t, used), 4},
    {offsetof(capture_t, time), 25},
    {offsetof(capture_t, edges[0]), 16},
    {offsetof(capture_t, edges[1]), 16},
    {offsetof(capture_t, edges[2]), 16},
    {offsetof(capture_t, edges[3]), 16},
    {offsetof(capture_t, edges[4]), 16},
    {offsetof(capture_t, edges[5]), 16},
    {offsetof(capture_t, edges[6]), 16},
    {offsetof(capture_t, edges[7]), 16},
    {0, 0},
};
