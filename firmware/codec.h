/* Frames on the wire: COBS(payload + 24-bit checksum) and a zero byte. Pure; also built for the host. */
#ifndef CODEC_H
#define CODEC_H

#include <stdint.h>

#include "protocol.h"

/* COBS adds one byte to fewer than 255; the delimiter is one more. */
#define WIRE_LONGEST (PAYLOAD_LONGEST + CHECK_BYTES + 2)

/* What is gathered of one frame while its bytes come in. */
typedef struct {
    uint8_t bytes[WIRE_LONGEST];
    uint8_t used; /* one more than the buffer holds: too long, wait for the delimiter */
} codec_t;

uint32_t codec_check(const void *payload, uint8_t size);

/* The checksum as bytes, in the order of the wire. Over a payload and these, codec_check gives 0. */
void codec_sign(const void *payload, uint8_t size, uint8_t check[CHECK_BYTES]);

/* Writes a frame to `wire` (WIRE_LONGEST bytes) and returns its length. */
uint8_t codec_encode(const void *payload, uint8_t size, uint8_t *wire);

enum { CODEC_MORE, CODEC_FRAME, CODEC_DAMAGED };

/* Takes one byte. After CODEC_FRAME the payload stands in `bytes` from the second on, and its length
   is that of its type; it stays until the next byte comes. */
uint8_t codec_receive(codec_t *codec, uint8_t byte);

#endif
