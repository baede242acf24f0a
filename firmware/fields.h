/* Fields of any width in a row of bytes, most significant bit first, by a table. */
#ifndef FIELDS_H
#define FIELDS_H

#include <stdbool.h>
#include <stdint.h>

#include "progmem.h"

/* One field: where it stands in its structure, and its bits. The structure holds it in 1, 2 or 4
   bytes, the fewest that fit. A width of 0 ends the table. */
typedef struct {
    uint8_t offset;
    uint8_t width;
} field_t;

#define FIELD_SIGNED 0x80

/* Writes type and fields, and fills the last byte up with zero bits. */
void fields_pack(const field_t *table, uint8_t type, const void *from, uint8_t *bytes);

/* Reads the fields behind a type; false when the last byte is not filled up with zero bits. */
bool fields_unpack(const field_t *table, void *to, const uint8_t *bytes);

#endif
