/* Fields of any width in a row of bytes, most significant bit first. */
#ifndef BITS_H
#define BITS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint8_t *byte;
    uint8_t mask;
} bits_t;

static inline bits_t bits_begin(uint8_t *bytes)
{
    bits_t at = {bytes, 0x80};
    return at;
}

void bits_put(bits_t *at, uint32_t value, uint8_t width);
uint32_t bits_get(bits_t *at, uint8_t width);

/* Fills the last byte up with zero bits. */
void bits_end(bits_t *at);

/* True when only zero bits fill the last byte up. */
bool bits_rest_is_zero(bits_t *at);

static inline int32_t bits_get_signed(bits_t *at, uint8_t width)
{
    uint32_t sign = 1UL << (width - 1);
    return (int32_t)((bits_get(at, width) ^ sign) - sign);
}

#endif
