#include "reset.h"

#include <avr/eeprom.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "protocol.h"

#define MAGIC 0xD1FB
#define HUNG_MS 100
/* The watchdog resets after 250 ms: a reset after most of this time without a pass is its own. */
#define BITTEN_MS 200
#define PAINT 0xA5
#define GAP 64
/* EEPROM cell that counts power-ups, after the slots of the settings: RAM, which counts the other
   starts, is lost at a power-up. */
#define POWER_UPS ((uint8_t *)128)

/* Memory that keeps its content over a restart. The bootloader clears the chip's reset flags (MCUSR);
   the cause is determined from this memory when they are empty. */
static struct {
    uint16_t magic;
    uint8_t boots;
    volatile uint8_t silent; /* ms since the last pass of the main loop */
} kept __attribute__((section(".noinit")));

uint8_t reset_cause;
extern uint8_t _end;
static uint8_t *lowest; /* lowest address of the stack in use so far */

/* After a watchdog reset the watchdog is still running: stop it before it resets the start-up. */
static uint8_t flags __attribute__((section(".noinit")));
void reset_early(void) __attribute__((naked, used, section(".init3")));
void reset_early(void)
{
    flags = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

static void paint_stack(void)
{
    lowest = (uint8_t *)SP;
    for (uint8_t *at = &_end; at < (uint8_t *)SP - 8; at++)
        *at = PAINT;
}

static uint8_t cause(void)
{
    bool kept_memory = kept.magic == MAGIC;
    if (flags & 1 << WDRF)
        return RESET_WATCHDOG;
    if (flags & 1 << PORF)
        return RESET_POWER;
    if (flags & 1 << BORF)
        return RESET_BROWNOUT;
    if (kept_memory && kept.silent >= BITTEN_MS)
        return RESET_WATCHDOG;
    if (flags & 1 << EXTRF || kept_memory)
        return RESET_LINE;
    return RESET_POWER;
}

void reset_begin(void)
{
    reset_cause = cause();
    if (kept.magic != MAGIC) {
        kept.boots = (uint8_t)(eeprom_read_byte(POWER_UPS) + 1);
        eeprom_write_byte(POWER_UPS, kept.boots); /* takes 3 ms in the background */
    }
    kept.magic = MAGIC;
    kept.boots++;
    kept.silent = 0;
    paint_stack();
    wdt_enable(WDTO_250MS);
}

uint8_t reset_boot(void)
{
    return kept.boots & 0xF;
}

void reset_feed(void)
{
    wdt_reset();
    kept.silent = 0;
}

bool reset_hung(void)
{
    if (kept.silent != UINT8_MAX)
        kept.silent++;
    return kept.silent >= HUNG_MS;
}

uint16_t reset_free_stack(void)
{
    /* Searching from the end of the variables would take milliseconds: start GAP below the last result,
       since no function leaves that many bytes untouched. */
    uint8_t *at = lowest - GAP;
    if (at < &_end)
        at = &_end;
    while (*at == PAINT)
        at++;
    lowest = at;
    return (uint16_t)(at - &_end);
}
