/* The robot as commanded: wheels, modes, settings in use. Everything a frame can do ends here. */
#ifndef ROBOT_H
#define ROBOT_H

#include <stdbool.h>
#include <stdint.h>

void robot_start(void);

/* Obeys one frame that came on `link`. */
void robot_obey(uint8_t link, const void *payload);

/* Each millisecond. */
void robot_tick(void);

#endif
