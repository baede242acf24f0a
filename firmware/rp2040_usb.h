/* The USB port of the RP2040, as the link LINK_USB. */
#ifndef RP2040_USB_H
#define RP2040_USB_H

#include <stdbool.h>
#include <stdint.h>

void rp2040_start_usb(void);

/* The byte that link_received is called for; takes the byte that link_empty sends. */
uint8_t rp2040_usb_received(void);
void rp2040_usb_send(uint8_t byte);

/* Sending on: link_empty is called until it sets it off. */
void rp2040_usb_sending(bool on);

#endif
