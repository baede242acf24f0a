/* The two serial links: UART0 (USB) and UART1 (Bluetooth). The same frames on both. */
#ifndef LINK_H
#define LINK_H

#include <stdbool.h>
#include <stdint.h>

#define LINKS 2

void link_start(void);

/* From the interrupts of a UART: a byte has come; there is room for one to go. */
void link_received(uint8_t link);
void link_empty(uint8_t link);

/* A BAUD_... code for a link; takes hold when what waits has gone out. */
void link_baud(uint8_t link, uint8_t code);

/* The next whole frame of a link, or null. It stays valid until the next call for that link. */
const void *link_receive(uint8_t link);

/* Queues a frame; false, and counted, when it does not fit. Never waits. */
bool link_send(uint8_t link, const void *payload, uint8_t size);

/* Bytes that wait to be sent. */
uint8_t link_backlog(uint8_t link);

/* Changes a baud rate that waits for silence. */
void link_tick(void);

/* Telemetry goes only where somebody has spoken validly. */
bool link_spoken(uint8_t link);

#endif
