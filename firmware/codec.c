#include "codec.h"

#include <stdbool.h>

#define CHECK_TOP 0x800000UL
#define CHECK_MASK 0xFFFFFFUL

uint32_t codec_check(const uint8_t *bytes, uint8_t size)
{
    uint32_t check = CHECK_START;
    for (uint8_t i = 0; i < size; i++) {
        check ^= (uint32_t)bytes[i] << 16;
        for (uint8_t bit = 0; bit < 8; bit++)
            check = check & CHECK_TOP ? (check << 1) ^ CHECK_POLYNOMIAL : check << 1;
    }
    return check & CHECK_MASK;
}

uint8_t codec_encode(const uint8_t *payload, uint8_t size, uint8_t *wire)
{
    uint32_t check = codec_check(payload, size);
    uint8_t code = 0; /* where the distance to the next zero goes */
    uint8_t used = 1;
    for (uint8_t i = 0; i < size + CHECK_BYTES; i++) {
        uint8_t shift = (uint8_t)(8 * (size + CHECK_BYTES - 1 - i));
        uint8_t byte = i < size ? payload[i] : (uint8_t)(check >> shift);
        if (byte == 0) {
            wire[code] = (uint8_t)(used - code);
            code = used;
        }
        wire[used++] = byte;
    }
    wire[code] = (uint8_t)(used - code);
    wire[used++] = 0;
    return used;
}

/* Undoes COBS in place; returns the length, or 0 when the codes do not end at the delimiter. */
static uint8_t unstuff(uint8_t *bytes, uint8_t size)
{
    uint8_t code = 0;
    uint8_t at = 0;
    while (code < size) {
        uint16_t next = (uint16_t)code + bytes[code]; /* a code may point beyond 255 */
        if (next > size)
            return 0;
        for (uint16_t i = code + 1U; i < next; i++)
            bytes[at++] = bytes[i];
        if (next < size)
            bytes[at++] = 0;
        code = (uint8_t)next;
    }
    return at;
}

static bool whole(uint8_t *bytes, uint8_t size)
{
    size = unstuff(bytes, size);
    uint8_t payload = payload_size(bytes[0] >> 4);
    if (payload == 0 || size != payload + CHECK_BYTES)
        return false;
    uint32_t check = (uint32_t)bytes[payload] << 16 | (uint16_t)(bytes[payload + 1] << 8)
        | bytes[payload + 2];
    return check == codec_check(bytes, payload);
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
        return CODEC_MORE; /* delimiters in a row are idle line */
    if (used == WIRE_LONGEST)
        return CODEC_DAMAGED;
    return whole(codec->bytes, used) ? CODEC_FRAME : CODEC_DAMAGED;
}
