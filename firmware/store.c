#include "store.h"

#include <avr/eeprom.h>
#include <string.h>

#include "codec.h"

#define SLOTS 2
#define SLOT_ROOM 64
/* Says that all other bytes of the slot were written; erased first and written last. */
#define COMPLETE 0xA5
#define ERASED 0xFF

typedef struct {
    uint8_t marker;
    uint8_t version; /* of the protocol, which gives the payload its meaning */
    uint8_t generation;
    uint8_t payload[SIZE_SETTINGS];
    uint8_t check[CHECK_BYTES];
} slot_t;

#define BODY (sizeof(slot_t) - 1)
#define STEPS (BODY + 2)

static slot_t writing;
static uint8_t slot, generation;
static uint8_t step = STEPS; /* of a write: 0 erases the marker, the last sets it */
static bool done;

static uint8_t *address(uint8_t number)
{
    return (uint8_t *)(uintptr_t)(number * SLOT_ROOM);
}

static void sign(slot_t *image)
{
    uint32_t check = codec_check(&image->version, BODY - CHECK_BYTES);
    image->check[0] = (uint8_t)(check >> 16);
    image->check[1] = (uint8_t)(check >> 8);
    image->check[2] = (uint8_t)check;
}

static bool read(uint8_t number, slot_t *image)
{
    slot_t wanted;
    eeprom_read_block(image, address(number), sizeof *image);
    wanted = *image;
    sign(&wanted);
    return image->marker == COMPLETE && image->version == PROTOCOL_VERSION
        && memcmp(wanted.check, image->check, CHECK_BYTES) == 0;
}

bool store_load(uint8_t payload[SIZE_SETTINGS])
{
    slot_t image;
    for (uint8_t number = 0; number < SLOTS; number++) {
        if (!read(number, &image) || (done && (int8_t)(image.generation - generation) < 0))
            continue;
        slot = number;
        generation = image.generation;
        memcpy(payload, image.payload, SIZE_SETTINGS);
        done = true;
    }
    return done;
}

void store_begin(const uint8_t payload[SIZE_SETTINGS])
{
    if (step == STEPS) { /* a write under way starts anew in its own slot */
        slot = (uint8_t)(slot + 1) % SLOTS;
        generation++;
    }
    writing.version = PROTOCOL_VERSION;
    writing.generation = generation;
    memcpy(writing.payload, payload, SIZE_SETTINGS);
    sign(&writing);
    step = 0;
    done = false;
}

void store_tick(void)
{
    if (step == STEPS || !eeprom_is_ready())
        return;
    uint8_t *to = address(slot);
    if (step == 0)
        eeprom_write_byte(to, ERASED);
    else if (step <= BODY)
        eeprom_write_byte(to + step, ((const uint8_t *)&writing)[step]);
    else
        eeprom_write_byte(to, COMPLETE);
    if (++step == STEPS)
        done = true;
}

bool store_done(void)
{
    return done;
}
