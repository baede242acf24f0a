#include "fields.h"

#include <string.h>

#define TYPE_BITS 4

static uint8_t held_in(uint8_t width)
{
    return width <= 8 ? 1 : width <= 16 ? 2 : 4;
}

static void put(uint8_t *bytes, uint16_t *at, uint32_t value, uint8_t width)
{
    value <<= 32 - width;
    for (; width != 0; width--, (*at)++, value <<= 1) {
        uint8_t mask = (uint8_t)(0x80 >> (*at & 7));
        if (value & 0x80000000UL)
            bytes[*at >> 3] |= mask;
        else
            bytes[*at >> 3] &= (uint8_t)~mask;
    }
}

static uint32_t get(const uint8_t *bytes, uint16_t *at, uint8_t width)
{
    uint32_t value = 0;
    for (; width != 0; width--, (*at)++) {
        value <<= 1;
        if (bytes[*at >> 3] & 0x80 >> (*at & 7))
            value |= 1;
    }
    return value;
}

void fields_pack(const field_t *table, uint8_t type, const void *from, uint8_t *bytes)
{
    uint16_t at = 0;
    put(bytes, &at, type, TYPE_BITS);
    for (field_t field;; table++) {
        memcpy_P(&field, table, sizeof field);
        uint8_t width = field.width & (uint8_t)~FIELD_SIGNED;
        if (width == 0)
            break;
        uint32_t value = 0; /* little-endian, as AVR and every host that builds this is */
        memcpy(&value, (const uint8_t *)from + field.offset, held_in(width));
        put(bytes, &at, value, width);
    }
    while (at & 7)
        put(bytes, &at, 0, 1);
}

bool fields_unpack(const field_t *table, void *to, const uint8_t *bytes)
{
    uint16_t at = TYPE_BITS;
    for (field_t field;; table++) {
        memcpy_P(&field, table, sizeof field);
        uint8_t width = field.width & (uint8_t)~FIELD_SIGNED;
        if (width == 0)
            break;
        uint32_t value = get(bytes, &at, width);
        uint32_t sign = 1UL << (width - 1);
        if (field.width & FIELD_SIGNED)
            value = (value ^ sign) - sign;
        memcpy((uint8_t *)to + field.offset, &value, held_in(width));
    }
    while (at & 7)
        if (get(bytes, &at, 1))
            return false;
    return true;
}
