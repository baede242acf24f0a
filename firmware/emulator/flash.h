/* The flash memory of the emulated board. */
#ifndef FLASH_H
#define FLASH_H

#include "board_state.h"

void flash_begin(board_t *board);
/* Loads an Intel hex file; its lowest address. */
uint32_t flash_load(board_t *board, const char *file);

#endif
