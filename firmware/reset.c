#include "reset.h"

#include "board.h"
#include "protocol.h"

#define MAGIC 0xD1FB
#define HUNG_MS 100
/* The watchdog resets after 120 ms or more: a reset after most of this time without a pass is its own. */
#define BITTEN_MS 110
/* Stored byte that counts power-ups, after the slots of the settings: RAM, which counts the other
   starts, is lost at a power-up. */
#define POWER_UPS 256

/* Memory that keeps its content over a restart. Bootloaders clear the chip's reset flags; the cause is
   determined from this memory then. */
static struct {
    uint16_t magic;
    uint8_t boots;
    volatile uint8_t silent; /* ms since the main loop has last done the work of one */
} kept __attribute__((section(".noinit")));

uint8_t reset_cause;

static uint8_t cause(void)
{
    bool kept_memory = kept.magic == MAGIC;
    uint8_t reported = board_reset_cause();
    if (reported != RESET_UNKNOWN && reported != RESET_LINE)
        return reported;
    if (kept_memory && kept.silent >= BITTEN_MS)
        return RESET_WATCHDOG;
    return reported == RESET_LINE || kept_memory ? RESET_LINE : RESET_POWER;
}

void reset_begin(void)
{
    reset_cause = cause();
    if (kept.magic != MAGIC) {
        board_store_read(POWER_UPS, &kept.boots, sizeof kept.boots);
        kept.boots++;
        board_store_write(POWER_UPS, kept.boots); /* takes 3 ms in the background */
    }
    kept.magic = MAGIC;
    kept.boots++;
    kept.silent = 0;
    board_paint_stack();
    board_start_watchdog();
}

uint8_t reset_boot(void)
{
    return kept.boots & 0xF;
}

void reset_feed(void)
{
    board_feed();
    kept.silent = 0;
}

bool reset_hung(void)
{
    if (kept.silent != UINT8_MAX)
        kept.silent++;
    return kept.silent >= HUNG_MS;
}
