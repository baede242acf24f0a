#include "link.h"

#include <avr/io.h>
#include <util/atomic.h>

#include "codec.h"
#include "progmem.h"
#include "status.h"

#define ROOM_IN 64   /* 5.5 ms at 115200 baud */
#define ROOM_OUT 128 /* five state frames */
#define NO_CHANGE 0xFF
#define LAST_BYTES_MS 4 /* two bytes may be in the UART: 2.1 ms at 9600 baud */

typedef struct {
    volatile uint8_t in_head, out_tail, out_head;
    uint8_t in_tail;
    uint8_t baud; /* code to change to, or NO_CHANGE */
    bool active; /* a valid frame was received */
    uint8_t idle; /* ms since the send ring is empty */
    codec_t codec;
    volatile uint8_t in[ROOM_IN];
    volatile uint8_t out[ROOM_OUT];
} port_t;

static port_t ports[LINKS];

/* Divisors at 16 MHz, double speed, for 9600, 19200, 38400, 57600, 115200 baud. */
static const uint8_t divisors[] PROGMEM = {207, 103, 51, 34, 16};

/* Registers of a UART, in the order of the data sheet: UCSRA, UCSRB, UCSRC, -, UBRR, UDR. Every AVR
   with several UARTs has them eight bytes apart. */
#define UART(link) (&UCSR0A + 8 * (link))
#define STATE 0
#define CONTROL 1
#define FORMAT 2
#define DIVISOR 4
#define DATA 6

__attribute__((noinline)) static void set_divisor(uint8_t link, uint8_t code)
{
    UART(link)[STATE] = 1 << U2X0;
    *(volatile uint16_t *)(UART(link) + DIVISOR) = pgm_read_byte(&divisors[code]);
}

void link_start(void)
{
    for (uint8_t link = 0; link < LINKS; link++) {
        ports[link].baud = NO_CHANGE;
        set_divisor(link, link == 0 ? BAUD_B115200 : BAUD_B9600);
        UART(link)[FORMAT] = 1 << UCSZ01 | 1 << UCSZ00;
        UART(link)[CONTROL] = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;
    }
}

void link_baud(uint8_t link, uint8_t code)
{
    ports[link].baud = code;
}

void link_received(uint8_t link)
{
    port_t *port = &ports[link];
    uint8_t byte = UART(link)[DATA];
    uint8_t next = (uint8_t)(port->in_head + 1) % ROOM_IN;
    if (next == port->in_tail)
        return; /* ring full: the frame without this byte fails its checksum */
    port->in[port->in_head] = byte;
    port->in_head = next;
}

void link_empty(uint8_t link)
{
    port_t *port = &ports[link];
    uint8_t tail = port->out_tail;
    if (tail == port->out_head) {
        UART(link)[CONTROL] &= (uint8_t)~(1 << UDRIE0);
        return;
    }
    UART(link)[DATA] = port->out[tail];
    port->out_tail = (uint8_t)(tail + 1) % ROOM_OUT;
}

const void *link_receive(uint8_t link)
{
    port_t *port = &ports[link];
    while (port->in_tail != port->in_head) {
        uint8_t byte = port->in[port->in_tail];
        port->in_tail = (uint8_t)(port->in_tail + 1) % ROOM_IN;
        switch (codec_receive(&port->codec, byte)) {
        case CODEC_FRAME:
            port->active = true;
            return port->codec.bytes + 1;
        case CODEC_DAMAGED:
            status[ITEM_DAMAGED]++;
            break;
        default:
            break;
        }
    }
    return 0;
}

uint8_t link_backlog(uint8_t link)
{
    return (uint8_t)(ports[link].out_head - ports[link].out_tail) % ROOM_OUT;
}

bool link_send(uint8_t link, const void *payload, uint8_t size)
{
    port_t *port = &ports[link];
    uint8_t wire[WIRE_LONGEST];
    if (size + CHECK_BYTES + 2 >= ROOM_OUT - link_backlog(link)) {
        status[ITEM_DROPPED]++;
        return false;
    }
    uint8_t length = codec_encode(payload, size, wire);
    uint8_t head = port->out_head;
    for (uint8_t i = 0; i < length; i++) {
        port->out[head] = wire[i];
        head = (uint8_t)(head + 1) % ROOM_OUT;
    }
    port->out_head = head;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) UART(link)[CONTROL] |= 1 << UDRIE0;
    return true;
}

void link_tick(void)
{
    for (uint8_t link = 0; link < LINKS; link++) {
        port_t *port = &ports[link];
        if (port->out_head != port->out_tail)
            port->idle = 0;
        else if (port->idle < LAST_BYTES_MS)
            port->idle++;
        if (port->baud == NO_CHANGE || port->idle < LAST_BYTES_MS)
            continue;
        set_divisor(link, port->baud);
        port->baud = NO_CHANGE;
    }
}

bool link_active(uint8_t link)
{
    return ports[link].active;
}
