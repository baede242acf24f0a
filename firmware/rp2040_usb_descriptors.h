/* Descriptors that the USB port sends to the host (USB 2.0, chapter 9; CDC 1.2 and its PSTN subclass). */
#ifndef RP2040_USB_DESCRIPTORS_H
#define RP2040_USB_DESCRIPTORS_H

#include <stdint.h>

#define USB_PACKET 64 /* bytes of the largest */
enum { USB_BULK = 2, USB_INTERRUPT = 3 }; /* types of endpoints */
#define USB_CONFIGURATION_BYTES 67
#define USB_STRINGS 4

extern const uint8_t usb_device[];
extern const uint8_t usb_configuration[USB_CONFIGURATION_BYTES];
extern const uint8_t *const usb_strings[USB_STRINGS];

/* Makes the serial number, the last of the strings, of the chip's identity. */
void usb_set_serial(const uint8_t *identity, uint8_t size);

#endif
