/* What changes slowly, in the order of the protocol's items. Whoever knows one keeps it here; two are
   counted by interrupts, so readers switch those off. */
#ifndef STATUS_H
#define STATUS_H

#include <stdint.h>

#include "protocol.h"

#define STATUS_ITEMS (ITEM_DROPPED + 1)

extern uint16_t status[STATUS_ITEMS];

#endif
