/* Frames on the wire: COBS(payload + 24-bit checksum) and a zero byte. Pure; also built for the host. */
#ifndef CODEC_H
#define CODEC_H

#include <stdint.h>

#include "protocol.h"

/* COBS adds one byte to up to 254; the delimiter is one more. */
#define WIRE_BYTES(payload) ((payload) + CHECK_BYTES + 2)
/* Room for frames that are longer than the types known here. */
#define WIRE_LONGEST WIRE_BYTES(RECEIVE_MOST)
_Static_assert(PAYLOAD_LONGEST <= RECEIVE_MOST, "every frame fits");

/* Receive state of one link: bytes of the frame so far. */
typedef struct {
    uint8_t bytes[WIRE_LONGEST];
    uint8_t used; /* WIRE_LONGEST: frame too long, skip to the delimiter */
    uint8_t size; /* payload of the last frame */
} codec_t;

uint32_t codec_check(const void *payload, uint8_t size);

/* The checksum as bytes, in wire order. codec_check over the payload and these bytes is 0. */
void codec_append_check(const void *payload, uint8_t size, uint8_t check[CHECK_BYTES]);

/* Writes a frame to `wire` (WIRE_LONGEST bytes) and returns its length. */
uint8_t codec_encode(const void *payload, uint8_t size, uint8_t *wire);

enum { CODEC_MORE, CODEC_FRAME, CODEC_DAMAGED };

/* Takes one byte. After CODEC_FRAME the payload starts at the second of `bytes` and has at least the length
   of its type, and codec_size bytes; it is valid until the next call. */
uint8_t codec_receive(codec_t *codec, uint8_t byte);

/* Length of the payload of the frame just received. */
uint8_t codec_size(const codec_t *codec);

#endif
