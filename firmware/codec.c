#include "codec.h"

#include <stdbool.h>

#define CHECK_TOP 0x800000UL
#define CHECK_MASK 0xFFFFFFUL

uint32_t codec_check(const void *payload, uint8_t size)
{
    const uint8_t *byte = payload;
    uint32_t check = CHECK_START;
    while (size--) {
        check ^= (uint32_t)*byte++ << 16;
        for (uint8_t bit = 8; bit != 0; bit--) {
            bool top = check & CHECK_TOP;
            check <<= 1;
            if (top)
                check ^= CHECK_POLYNOMIAL;
        }
    }
    return check & CHECK_MASK;
}

void codec_append_check(const void *payload, uint8_t size, uint8_t check[CHECK_BYTES])
{
    uint32_t value = codec_check(payload, size);
    check[2] = (uint8_t)value;
    check[1] = (uint8_t)(value >> 8);
    check[0] = (uint8_t)(value >> 16);
}

uint8_t codec_encode(const void *payload, uint8_t size, uint8_t *wire)
{
    uint8_t *code = wire; /* place of the distance to the next zero */
    uint8_t *to = wire + 1;
    const uint8_t *from = payload;
    for (uint8_t i = 0; i < size; i++)
        *to++ = from[i];
    codec_append_check(payload, size, to);
    to += CHECK_BYTES;
    for (uint8_t *at = wire + 1; at != to; at++)
        if (*at == 0) {
            *code = (uint8_t)(at - code);
            code = at;
        }
    *code = (uint8_t)(to - code);
    *to++ = 0;
    return (uint8_t)(to - wire);
}

/* Decodes COBS: replaces each code by the zero that it stands for; the payload begins after the first.
   False when the codes do not end at the delimiter. */
static bool unstuff(uint8_t *bytes, uint8_t size)
{
    uint8_t at = 0;
    do {
        uint8_t code = bytes[at];
        if (code > size - at)
            return false;
        bytes[at] = 0;
        at = (uint8_t)(at + code);
    } while (at != size);
    return true;
}

static bool whole(uint8_t *bytes, uint8_t size)
{
    if (size <= CHECK_BYTES + 1 || !unstuff(bytes, size))
        return false;
    uint8_t payload = payload_size(bytes[1] & 0xF);
    return size >= payload + CHECK_BYTES + 1 && codec_check(bytes + 1, size - 1) == 0;
}

uint8_t codec_receive(codec_t *codec, uint8_t byte)
{
    if (byte != 0) {
        if (codec->used < WIRE_LONGEST)
            codec->bytes[codec->used++] = byte;
        return CODEC_MORE;
    }
    uint8_t used = codec->used;
    codec->used = 0;
    if (used == 0)
        return CODEC_MORE; /* consecutive delimiters are an idle line */
    if (used == WIRE_LONGEST)
        return CODEC_DAMAGED;
    if (!whole(codec->bytes, used))
        return CODEC_DAMAGED;
    codec->size = (uint8_t)(used - CHECK_BYTES - 1);
    return CODEC_FRAME;
}

uint8_t codec_size(const codec_t *codec)
{
    return codec->size;
}
