#include "store.h"

#include "board.h"
#include "codec.h"

#define SLOTS 2
/* Marks a completely written slot; erased first and written last. */
#define COMPLETE 0xA5

typedef struct {
    uint8_t marker;
    uint8_t version; /* of the protocol, which defines the payload */
    uint8_t generation;
    settings_t settings;
    uint8_t check[CHECK_BYTES];
} slot_t;

#define BODY (sizeof(slot_t) - 1)
#define STEPS (BODY + 2)

static slot_t image; /* being written, or just read */
static uint8_t slot, generation;
/* Steps of a write; the first erases the marker, the last sets it. */
static uint8_t remaining;
static bool done;

static uint16_t address(uint8_t number)
{
    return (uint16_t)(number * BOARD_STORE_SLOT);
}

static bool read(uint8_t number)
{
    board_store_read(address(number), &image, sizeof image);
    return image.marker == COMPLETE && image.version == PROTOCOL_VERSION
        && codec_check(&image.version, BODY) == 0;
}

bool store_load(settings_t *settings)
{
    for (uint8_t number = 0; number < SLOTS; number++) {
        if (!read(number) || (done && (int8_t)(image.generation - generation) < 0))
            continue;
        slot = number;
        generation = image.generation;
        *settings = image.settings;
        done = true;
    }
    return done;
}

void store_begin(const settings_t *settings)
{
    if (remaining == 0) { /* a running write starts again in its slot */
        slot ^= 1;
        generation++;
    }
    image.version = PROTOCOL_VERSION;
    image.generation = generation;
    image.settings = *settings;
    codec_append_check(&image.version, BODY - CHECK_BYTES, image.check);
    remaining = STEPS;
    done = false;
}

void store_tick(void)
{
    if (remaining == 0 || !board_store_ready())
        return;
    uint16_t to = address(slot);
    remaining--;
    if (remaining == BODY + 1) {
        board_store_clear(to);
    } else if (remaining != 0) {
        board_store_write(to + remaining, ((const uint8_t *)&image)[remaining]);
    } else {
        board_store_write(to, COMPLETE);
        done = true;
    }
}

bool store_done(void)
{
    return done;
}
