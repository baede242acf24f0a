/* The serial links, with the same frames on all. */
#ifndef LINK_H
#define LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

void link_start(void);

/* From the interrupts of a UART: a byte was received; the next can be sent. */
void link_received(uint8_t link);
void link_empty(uint8_t link);

/* Sets a BAUD_... code of a link; takes effect when the waiting bytes have been sent. */
void link_baud(uint8_t link, uint8_t code);

/* Payload of the next frame of a link, or null. Valid until the next call for that link. */
const void *link_receive(uint8_t link);

/* Length of that payload; at least that of its type. */
uint8_t link_size(uint8_t link);

/* Queues a frame; when it does not fit, counts it as dropped and returns false. Never waits. */
bool link_send(uint8_t link, const void *payload, uint8_t size);

/* Queues a delimiter, so that the next frame is not taken for the rest of a frame that a reset cut. */
void link_delimit(uint8_t link);

/* Number of bytes that wait to be sent. */
uint8_t link_backlog(uint8_t link);

/* Applies a new baud rate when the line is idle. To be called each millisecond. */
void link_tick(void);

/* True when a valid frame was received on the link: telemetry is sent only there. Not while the link of USB and
   radio changes from the rate of USB to that of the settings: a frame at the former rate would be misdated. */
bool link_active(uint8_t link);

#endif
