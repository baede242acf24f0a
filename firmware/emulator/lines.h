/* The serial lines of the emulated board. */
#ifndef LINES_H
#define LINES_H

#include "board_state.h"

void lines_begin(board_t *board);
void lines_reset(board_t *board);
void lines_end(board_t *board);

/* Bytes that arrive at a UART from now on, back to back. */
void lines_receive(board_t *board, unsigned number, const uint8_t *bytes, unsigned count);

/* True when a client has opened the pseudo-terminal of UART0: the USB chip resets the board. */
bool lines_opened(board_t *board);

/* Takes what clients have written to the pseudo-terminals. */
void lines_poll(board_t *board);

#endif
