/* The robot: wheels, mode, settings in use. Carries out the frames. */
#ifndef ROBOT_H
#define ROBOT_H

#include <stdbool.h>
#include <stdint.h>

void robot_start(void);

/* Carries out one frame received on `link`. */
void robot_handle(uint8_t link, const void *payload);

/* To be called each millisecond. */
void robot_tick(void);

#endif
