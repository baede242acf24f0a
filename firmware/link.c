#include "link.h"

#include "board.h"
#include "codec.h"
#include "status.h"

#define ROOM_IN LINK_ROOM_IN
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

void link_start(void)
{
    for (uint8_t link = 0; link < LINKS; link++) {
        ports[link].baud = NO_CHANGE;
        ports[link].idle = LAST_BYTES_MS; /* nothing has been sent */
        board_start_link(link, link == 0 ? BAUD_B115200 : BAUD_B9600);
    }
}

void link_baud(uint8_t link, uint8_t code)
{
    ports[link].baud = code;
}

void link_received(uint8_t link)
{
    port_t *port = &ports[link];
    uint8_t byte = board_received(link);
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
        board_sending(link, false);
        return;
    }
    board_send(link, port->out[tail]);
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

uint8_t link_size(uint8_t link)
{
    return codec_size(&ports[link].codec);
}

uint8_t link_backlog(uint8_t link)
{
    return (uint8_t)(ports[link].out_head - ports[link].out_tail) % ROOM_OUT;
}

bool link_send(uint8_t link, const void *payload, uint8_t size)
{
    port_t *port = &ports[link];
    uint8_t wire[WIRE_BYTES(PAYLOAD_LONGEST)];
    if (WIRE_BYTES(size) >= ROOM_OUT - link_backlog(link)) {
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
    board_sending(link, true);
    return true;
}

void link_delimit(uint8_t link)
{
    port_t *port = &ports[link];
    if (link_backlog(link) == ROOM_OUT - 1)
        return;
    port->out[port->out_head] = 0;
    port->out_head = (uint8_t)(port->out_head + 1) % ROOM_OUT;
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
        board_set_baud(link, port->baud);
        port->baud = NO_CHANGE;
    }
}

bool link_active(uint8_t link)
{
    return ports[link].active && (LINK_OF_RATE != 0 || ports[link].baud == NO_CHANGE);
}
