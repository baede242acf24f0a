/* The USB port of the RP2040, as the link LINK_USB. All but starting it and `sending` is for its interrupt. */
#ifndef RP2040_USB_H
#define RP2040_USB_H

#include <stdbool.h>
#include <stdint.h>

void rp2040_start_usb(void);

/* Answers the host, and takes note of the packets that have gone and come. */
void rp2040_usb_handle(void);

/* True when the host asks for BOOTSEL. */
bool rp2040_usb_wants_boot(void);

/* True while bytes of the host are there; takes the next one. */
bool rp2040_usb_has_byte(void);
uint8_t rp2040_usb_received(void);

/* Sending on or off; on raises the interrupt, which begins a packet if it can, fills it and ends it. */
void rp2040_usb_sending(bool on);
bool rp2040_usb_begin_packet(void);
bool rp2040_usb_has_room(void);
void rp2040_usb_send(uint8_t byte);
void rp2040_usb_end_packet(void);

#endif
