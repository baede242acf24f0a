#include "bits.h"

static void next(bits_t *at)
{
    at->mask >>= 1;
    if (at->mask == 0) {
        at->mask = 0x80;
        at->byte++;
    }
}

void bits_put(bits_t *at, uint32_t value, uint8_t width)
{
    for (uint32_t bit = 1UL << (width - 1); bit != 0; bit >>= 1) {
        if (value & bit)
            *at->byte |= at->mask;
        else
            *at->byte &= (uint8_t)~at->mask;
        next(at);
    }
}

uint32_t bits_get(bits_t *at, uint8_t width)
{
    uint32_t value = 0;
    for (; width != 0; width--) {
        value <<= 1;
        if (*at->byte & at->mask)
            value |= 1;
        next(at);
    }
    return value;
}

void bits_end(bits_t *at)
{
    while (at->mask != 0x80)
        bits_put(at, 0, 1);
}

bool bits_rest_is_zero(bits_t *at)
{
    while (at->mask != 0x80)
        if (bits_get(at, 1))
            return false;
    return true;
}
