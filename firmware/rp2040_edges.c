/* Which of the RP2040's pins raise an interrupt, and which have: the edges of encoders and echoes. */
#include "atomic.h"
#include "board.h"
#include "protocol.h"
#include "rp2040_registers.h"

#define LAST_EDGES (1u << 22)
#define SHIFT(pin) (4 * ((pin) % PINS_PER_REGISTER))
#define AT(pin) (4u * ((pin) / PINS_PER_REGISTER))

static const bit_t *watched;

static uint8_t watched_pin(void)
{
    uint8_t pin = 0;
    while (!(watched->mask >> pin & 1))
        pin++;
    return pin;
}

static void forget(uint8_t pin)
{
    REGISTER(IO_EDGES + AT(pin)) = (uint32_t)EDGE_BITS << SHIFT(pin);
}

void board_mute(uint8_t number)
{
    if (number < BOARD_LINK)
        CLEAR(IO_ENABLED + AT(number)) = (uint32_t)EDGE_BITS << SHIFT(number);
}

void board_mute_all(void)
{
    for (uint8_t pin = 0; pin < 32; pin += PINS_PER_REGISTER)
        REGISTER(IO_ENABLED + AT(pin)) = 0;
    watched = 0;
}

void board_sense(uint8_t number, uint8_t sense)
{
    uint32_t edges = sense == EDGE_RISING ? EDGE_HIGH_BIT : sense == EDGE_FALLING ? EDGE_LOW_BIT : EDGE_BITS;
    if (number >= BOARD_LINK)
        return;
    board_mute(number);
    forget(number);
    SET(IO_ENABLED + AT(number)) = edges << SHIFT(number);
}

/* The interrupt of all pins is one. */
uint8_t board_group(const bit_t *bit)
{
    return bit->mask > LAST_EDGES ? NO_GROUP : 0;
}

void board_watch(const bit_t *bit)
{
    ATOMIC
    {
        if (watched)
            board_mute(watched_pin());
        watched = bit;
        if (watched)
            board_sense(watched_pin(), EDGE_BOTH);
    }
}

bool rp2040_watched_changed(const edges_t *edges)
{
    return watched && rp2040_changed(edges, watched_pin());
}
