/* The emulated board: simavr's chip, and the parts that simavr lacks. */
#ifndef EMULATED_BOARD_H
#define EMULATED_BOARD_H

#include "board_state.h"

void board_begin(board_t *board, const options_t *options);
void board_end(board_t *board);
void board_run(board_t *board, uint64_t until);
void board_reset(board_t *board, uint8_t cause);
void board_hang(board_t *board);
void board_transition(board_t *board, uint64_t time, uint8_t pin, uint8_t level);
/* Pulses at a pin from now on, in place of those that it has; all 0 ends them. Times are ns. */
bool board_pulses(board_t *board, uint8_t pin, uint32_t high, uint32_t low, uint32_t jitter);
void board_analog(board_t *board, uint8_t channel, uint16_t millivolts);
void board_eeprom_get(board_t *board, uint8_t *bytes);
void board_eeprom_set(board_t *board, const uint8_t *bytes);

#endif
