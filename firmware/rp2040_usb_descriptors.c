#include "rp2040_usb_descriptors.h"

#define LOW(value) ((value) & 0xFF)
#define HIGH(value) ((value) >> 8)
#define WORD(value) LOW(value), HIGH(value)
#define VENDOR 0x2E8A /* Raspberry Pi */
#define PRODUCT 0x000A /* a program with a serial port on a Pico */

enum { DEVICE = 1, CONFIGURATION, STRING, INTERFACE, ENDPOINT, FUNCTIONAL = 0x24 };
enum { COMMUNICATION = 2, DATA = 10, ABSTRACT_CONTROL = 2 }; /* classes and the subclass */
enum { NOTES = 0x81, TO_HOST = 0x82, FROM_HOST = 0x02 }; /* addresses of the endpoints */
#define NOTE_PACKET 8
#define NOTE_PERIOD 16 /* ms */
#define MOST_100_MA 50
#define SUPPLIED_BY_USB 0x80

const uint8_t usb_device[] = {
    18, DEVICE, WORD(0x0200), COMMUNICATION, 0, 0, USB_PACKET, WORD(VENDOR), WORD(PRODUCT), WORD(0x0100), 1, 2, 3, 1,
};

const uint8_t usb_configuration[USB_CONFIGURATION_BYTES] = {
    9, CONFIGURATION, WORD(USB_CONFIGURATION_BYTES), 2, 1, 0, SUPPLIED_BY_USB, MOST_100_MA,
    9, INTERFACE, 0, 0, 1, COMMUNICATION, ABSTRACT_CONTROL, 0, 0,
    5, FUNCTIONAL, 0, WORD(0x0120),
    5, FUNCTIONAL, 1, 0, 1, /* no call management */
    4, FUNCTIONAL, 2, 2, /* line coding and control lines */
    5, FUNCTIONAL, 6, 0, 1, /* interface 0 controls interface 1 */
    7, ENDPOINT, NOTES, USB_INTERRUPT, WORD(NOTE_PACKET), NOTE_PERIOD,
    9, INTERFACE, 1, 0, 2, DATA, 0, 0, 0,
    7, ENDPOINT, TO_HOST, USB_BULK, WORD(USB_PACKET), 0,
    7, ENDPOINT, FROM_HOST, USB_BULK, WORD(USB_PACKET), 0,
};

/* Length, type, then two bytes a character. */
static const uint8_t languages[] = {4, STRING, WORD(0x0409)};
static const uint8_t maker[] = {22, STRING, 'd', 0, 'i', 0, 'f', 0, 'f', 0, 'b', 0, 'o', 0, 't', 0, 'c', 0, 't', 0, 'l', 0};
static const uint8_t name[] = {10, STRING, 'P', 0, 'i', 0, 'c', 0, 'o', 0};
#define SERIAL_BYTES 34 /* 16 hexadecimal digits */
static uint8_t serial[SERIAL_BYTES] = {2, STRING};
const uint8_t *const usb_strings[USB_STRINGS] = {languages, maker, name, serial};

void usb_set_serial(const uint8_t *identity, uint8_t size)
{
    static const uint8_t digits[] = "0123456789ABCDEF";
    for (; size-- && serial[0] + 2 * 2 <= SERIAL_BYTES; identity++) {
        serial[serial[0]] = digits[*identity >> 4];
        serial[serial[0] + 2] = digits[*identity & 0xF];
        serial[0] += 2 * 2;
    }
}
