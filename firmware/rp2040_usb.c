/* The RP2040's USB port: a serial port as every system knows it (class CDC, abstract control model).

   Bytes of the host go to the link as they come: its ring has room for more than one packet, so nothing has to
   wait here. What the link sends is collected into packets of up to 64 bytes. Section 4.1 of the data sheet. */
#include "rp2040_usb.h"

#include "board.h"
#include "rp2040_registers.h"
#include "rp2040_usb_descriptors.h"

#define MEMORY 0x50100000u /* of the controller: setup packet, controls of the endpoints, packets */
#define ENDPOINT_CONTROL(endpoint) (MEMORY + 8 * (endpoint)) /* to the host; after it from the host */
#define BUFFER_CONTROL(buffer) (MEMORY + 0x80 + 4 * (buffer))
enum { ENDPOINT_ON = 1u << 31, ENDPOINT_INTERRUPTS = 1u << 29, ENDPOINT_TYPE_BIT = 26 };
enum { BUFFER_FULL = 1 << 15, BUFFER_DATA1 = 1 << 13, BUFFER_STALL = 1 << 11, BUFFER_READY = 1 << 10 };
#define BUFFER_SIZE 0x3FF

/* Buffers: two of an endpoint, and where their packets are. */
enum { CONTROL_IN = 0, CONTROL_OUT = 1, NOTES_IN = 2, DATA_IN = 4, DATA_OUT = 5, BUFFERS = 6 };
static const uint16_t packets[BUFFERS] = {0x100, 0x100, 0x180, 0, 0x1C0, 0x200};

#define USB 0x50110000u
#define USB_ADDRESS USB
#define USB_CONTROL (USB + 0x40)
#define USB_PULL_UP (USB + 0x4C)
#define USB_STATUS (USB + 0x50)
#define USB_BUFFERS (USB + 0x58)
#define USB_STALLS (USB + 0x68)
#define USB_PINS (USB + 0x74)
#define USB_POWER (USB + 0x78)
#define USB_MASK (USB + 0x90)
#define USB_RAISED (USB + 0x98)
enum { CONTROLLER_ON = 1, INTERRUPT_PER_BUFFER = 1 << 29, PULL_UP_ON = 1 << 16 };
enum { PINS_OF_PORT = 1 << 0, PINS_CONNECTED = 1 << 3, POWER_FOUND = 1 << 3, POWER_FORCED = 1 << 2 };
enum { STATUS_SETUP = 1 << 17, STATUS_RESET = 1 << 19 };
enum { RAISED_BUFFERS = 1 << 4, RAISED_RESET = 1 << 12, RAISED_SETUP = 1 << 16 };

/* Requests, with their type in the high byte. */
enum {
    GET_STATUS = 0x8000, CLEAR_FEATURE = 0x0201, SET_ADDRESS = 0x0005, GET_DESCRIPTOR = 0x8006, SET_CONFIGURATION = 0x0009,
    SET_LINE_CODING = 0x2120, GET_LINE_CODING = 0xA121, SET_CONTROL_LINES = 0x2122,
};
enum { DEVICE = 1, CONFIGURATION = 2, STRING = 3 };
#define TERMINAL_READY 1 /* of the control lines: a program has opened the port */
#define MOST_WAITING 3   /* frames: a host takes a packet within a millisecond */
#define TOUCH_BAUD 1200  /* a port opened at this rate and closed again asks for BOOTSEL, as with other boards */

typedef struct {
    uint8_t type, request;
    uint16_t value, index, size;
} setup_t;

typedef struct {
    uint32_t baud;
    uint8_t stop_bits, parity, bits;
} line_t;
#define LINE_BYTES 7

static uint16_t toggles; /* a bit for each buffer: the next packet is a DATA1 */
static const uint8_t *answer; /* rest of what the host reads by the control endpoint */
static uint8_t answer_size;
static uint8_t address; /* that the host gives; 0 when there is none to take */
static bool takes_line; /* the next packet from the host is its line coding */
static bool configured, is_open, wants_boot;
static bool sending, busy; /* there is something to send; a packet waits for the host */
static bool dropping;
static uint8_t filled, waiting; /* bytes of the packet; frames that came while it waits */
static uint8_t received, taken; /* bytes of the packet from the host; how many of them are taken */
static line_t line = {115200, 0, 0, 8};

static volatile uint8_t *packet(uint8_t buffer)
{
    return (volatile uint8_t *)(MEMORY + packets[buffer]);
}

/* Gives a buffer to the controller; one to the host is full. It must see the rest before the last bit (section
   4.1.2.5.1). */
static void give(uint8_t buffer, uint8_t size)
{
    uint32_t control = size;
    if (!(buffer & 1))
        control |= BUFFER_FULL;
    if (toggles >> buffer & 1)
        control |= BUFFER_DATA1;
    toggles ^= (uint16_t)(1u << buffer);
    REGISTER(BUFFER_CONTROL(buffer)) = control;
    __asm__ volatile("nop\nnop\nnop");
    REGISTER(BUFFER_CONTROL(buffer)) = control | BUFFER_READY;
}

static void give_answer(void)
{
    uint8_t size = answer_size < USB_PACKET ? answer_size : USB_PACKET;
    for (uint8_t i = 0; i < size; i++)
        packet(CONTROL_IN)[i] = answer[i];
    answer += size;
    answer_size = (uint8_t)(answer_size - size);
    give(CONTROL_IN, size);
}

static void reply(const void *data, uint16_t size, const setup_t *setup)
{
    answer = data;
    answer_size = (uint8_t)(size < setup->size ? size : setup->size);
    give_answer();
}

static void refuse(void)
{
    REGISTER(USB_STALLS) = 3;
    REGISTER(BUFFER_CONTROL(CONTROL_IN)) = BUFFER_STALL;
    REGISTER(BUFFER_CONTROL(CONTROL_OUT)) = BUFFER_STALL;
}

static void describe(const setup_t *setup)
{
    uint8_t index = (uint8_t)setup->value;
    switch (setup->value >> 8) {
    case DEVICE:
        reply(usb_device, usb_device[0], setup);
        break;
    case CONFIGURATION:
        reply(usb_configuration, USB_CONFIGURATION_BYTES, setup);
        break;
    case STRING:
        if (index < USB_STRINGS) {
            reply(usb_strings[index], usb_strings[index][0], setup);
            break;
        }
        /* fall through */
    default:
        refuse();
    }
}

static void open_endpoint(uint8_t buffer, uint8_t type)
{
    REGISTER(ENDPOINT_CONTROL(buffer / 2) + 4 * (buffer & 1))
        = ENDPOINT_ON | ENDPOINT_INTERRUPTS | (uint32_t)type << ENDPOINT_TYPE_BIT | packets[buffer];
}

static void configure(bool on)
{
    configured = on;
    busy = is_open = false;
    waiting = received = taken = 0;
    toggles &= 3; /* the control endpoint goes on */
    if (!on)
        return;
    open_endpoint(NOTES_IN, USB_INTERRUPT);
    open_endpoint(DATA_IN, USB_BULK);
    open_endpoint(DATA_OUT, USB_BULK);
    give(DATA_OUT, USB_PACKET);
}

static void set_lines(bool ready)
{
    if (is_open && !ready && line.baud == TOUCH_BAUD)
        wants_boot = true;
    is_open = ready;
}

static void handle_setup(void)
{
    static const uint8_t nothing[2];
    const setup_t setup = *(const volatile setup_t *)MEMORY;
    toggles |= 3; /* what follows begins with a DATA1 */
    takes_line = false;
    answer = 0;
    answer_size = 0;
    switch (setup.type << 8 | setup.request) {
    case GET_DESCRIPTOR:
        describe(&setup);
        return;
    case GET_STATUS:
        reply(nothing, sizeof nothing, &setup);
        return;
    case GET_LINE_CODING:
        reply(&line, LINE_BYTES, &setup);
        return;
    case SET_LINE_CODING:
        takes_line = true;
        give(CONTROL_OUT, USB_PACKET);
        return;
    case SET_ADDRESS:
        address = (uint8_t)setup.value;
        break;
    case SET_CONFIGURATION:
        configure(setup.value);
        break;
    case SET_CONTROL_LINES:
        set_lines(setup.value & TERMINAL_READY);
        break;
    case CLEAR_FEATURE:
        toggles &= (uint16_t)~(1u << (2 * (setup.index & 0xF) + !(setup.index & 0x80)));
        break;
    default:
        refuse();
        return;
    }
    give(CONTROL_IN, 0);
}

/* The end of a packet by the control endpoint: the new address counts after the reply to it; what the host has
   read it confirms with an empty packet. */
static void control_sent(void)
{
    if (address) {
        REGISTER(USB_ADDRESS) = address;
        address = 0;
    } else if (answer_size) {
        give_answer();
    } else if (answer) {
        answer = 0;
        toggles |= 1u << CONTROL_OUT;
        give(CONTROL_OUT, 0);
    }
}

static void control_received(void)
{
    if (!takes_line)
        return;
    takes_line = false;
    for (uint8_t i = 0; i < LINE_BYTES; i++)
        ((uint8_t *)&line)[i] = packet(CONTROL_OUT)[i];
    toggles |= 1u << CONTROL_IN;
    give(CONTROL_IN, 0);
}

void rp2040_usb_handle(void)
{
    uint32_t raised = REGISTER(USB_RAISED);
    if (raised & RAISED_RESET) {
        REGISTER(USB_STATUS) = STATUS_RESET;
        REGISTER(USB_ADDRESS) = 0;
        configure(false);
    }
    if (raised & RAISED_BUFFERS) {
        uint32_t done = REGISTER(USB_BUFFERS);
        REGISTER(USB_BUFFERS) = done;
        if (done >> CONTROL_IN & 1)
            control_sent();
        if (done >> CONTROL_OUT & 1)
            control_received();
        if (done >> DATA_IN & 1) {
            busy = false;
            waiting = 0;
        }
        if (done >> DATA_OUT & 1 && configured)
            received = (uint8_t)(REGISTER(BUFFER_CONTROL(DATA_OUT)) & BUFFER_SIZE);
    }
    if (raised & RAISED_SETUP) {
        REGISTER(USB_STATUS) = STATUS_SETUP;
        handle_setup();
    }
}

bool rp2040_usb_wants_boot(void)
{
    return wants_boot;
}

bool rp2040_usb_has_byte(void)
{
    if (taken < received)
        return true;
    if (received)
        give(DATA_OUT, USB_PACKET);
    received = taken = 0;
    return false;
}

uint8_t rp2040_usb_received(void)
{
    return packet(DATA_OUT)[taken++];
}

/* What no program reads is dropped: no program has the port open, or the cable is off and the packet stays. It
   would be old when it is read, and the link's ring would count it as lost. */
bool rp2040_usb_begin_packet(void)
{
    dropping = !is_open || waiting == MOST_WAITING;
    filled = 0;
    return !busy || dropping;
}

bool rp2040_usb_has_room(void)
{
    return sending && filled < USB_PACKET;
}

void rp2040_usb_send(uint8_t byte)
{
    if (!dropping)
        packet(DATA_IN)[filled++] = byte;
}

void rp2040_usb_end_packet(void)
{
    busy |= filled != 0;
    if (filled)
        give(DATA_IN, filled);
}

/* The interrupt fills the packet: edges may interrupt that, which they may not here. */
void rp2040_usb_sending(bool on)
{
    sending = on;
    if (!on)
        return;
    if (busy && waiting < MOST_WAITING)
        waiting++;
    REGISTER(INTERRUPTS_RAISED) = 1u << INTERRUPT_USB;
}

void rp2040_start_usb(void)
{
    uint8_t identity[IDENTITY_BYTES];
    rp2040_read_identity(identity);
    usb_set_serial(identity, sizeof identity);
    for (uint32_t at = MEMORY; at < MEMORY + 0x100; at += 4)
        REGISTER(at) = 0;
    REGISTER(USB_PINS) = PINS_OF_PORT | PINS_CONNECTED;
    REGISTER(USB_POWER) = POWER_FOUND | POWER_FORCED;
    REGISTER(USB_CONTROL) = CONTROLLER_ON;
    REGISTER(USB_MASK) = RAISED_BUFFERS | RAISED_RESET | RAISED_SETUP;
    REGISTER(USB_PULL_UP) = INTERRUPT_PER_BUFFER | PULL_UP_ON;
}
