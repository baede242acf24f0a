#include "storm.h"

#include "board.h"

/* On an AVR board 32 interrupts a millisecond are enough for 20,000 edges a second without a glitch filter
   and 10,000 with one, which needs rising and falling edges, and for bounce. Unused ones are kept for a
   main loop that is late. */
#define ALLOWANCE_PER_MS BOARD_EDGES_PER_MS
#define ALLOWANCE_MOST (5 * BOARD_EDGES_PER_MS)
/* A muted pin is tried again after 2 ms, since a discharge or a relay may have been the cause; in a
   storm after 50 ms, and with so few interrupts that no byte of a serial link is lost. */
_Static_assert((uint_fast8_t)ALLOWANCE_MOST == ALLOWANCE_MOST, "it has one byte on an AVR board, more elsewhere");
#define PAUSE_MS 2
#define STORM_PAUSE_MS 50
#define PROBE_ALLOWANCE 16
/* Muted twice within 40 ms is a storm. It is over when the pin was quiet for 200 ms. */
#define SCORE_PER_MUTING 40
#define SCORE_OF_STORM 42
#define SCORE_MOST 200
/* A wheel cannot turn eight times as fast as at full duty; nor does a sensor that bounces. */
#define SPEED_MARGIN 8
#define EDGES_LEAST 40 /* between two checks: 400 edges/s */
/* Changes without edges: each edge of a bouncing sensor has fewer changes than this. */
#define CHANGES_PER_EDGE 24
#define CHANGES_LEAST 50
#define CHECKS 2
#define CHECKS_MOST 4

void storm_begin(storm_t *storm, uint32_t edges_per_s)
{
    uint32_t most = edges_per_s * SPEED_MARGIN / (1000 / STORM_CHECK_MS);
    *storm = (storm_t){.allowance = ALLOWANCE_MOST, .edges_most = UINT16_MAX};
    if (edges_per_s != 0 && most < UINT16_MAX)
        storm->edges_most = most < EDGES_LEAST ? EDGES_LEAST : (uint16_t)most;
}

bool storm_tick(storm_t *storm)
{
    if (!storm->muted) {
        if (storm->score != 0)
            storm->score--;
        if (storm->allowance > ALLOWANCE_MOST - ALLOWANCE_PER_MS)
            storm->allowance = ALLOWANCE_MOST - ALLOWANCE_PER_MS;
        storm->allowance += ALLOWANCE_PER_MS;
        return false;
    }
    if (storm->pause_ms == 0) { /* muted since the last tick */
        storm->score = storm->score < SCORE_MOST - SCORE_PER_MUTING
            ? storm->score + SCORE_PER_MUTING : SCORE_MOST;
        storm->pause_ms = storm->score >= SCORE_OF_STORM ? STORM_PAUSE_MS : PAUSE_MS;
        return false;
    }
    if (--storm->pause_ms != 0)
        return false;
    storm->muted = false;
    storm->allowance = PROBE_ALLOWANCE;
    return true;
}

void storm_check(storm_t *storm, uint16_t changes, uint16_t edges)
{
    uint16_t new_changes = (uint16_t)(changes - storm->checked_changes);
    uint16_t new_edges = (uint16_t)(edges - storm->checked_edges);
    storm->checked_changes = changes;
    storm->checked_edges = edges;
    bool noise = new_changes >= CHANGES_LEAST && new_changes / CHANGES_PER_EDGE > new_edges;
    if (noise || new_edges > storm->edges_most) {
        if (storm->implausible < CHECKS_MOST)
            storm->implausible++;
    } else if (storm->implausible != 0) {
        storm->implausible--;
    }
}

bool storm_present(const storm_t *storm)
{
    return storm->score >= SCORE_OF_STORM || storm->implausible >= CHECKS;
}
