/* Slowly changing values, in the order of the protocol's items. Each module writes its own; interrupts
   count two of them, so readers switch interrupts off. */
#ifndef STATUS_H
#define STATUS_H

#include <stdint.h>

#include "protocol.h"

#define STATUS_ITEMS (ITEM_DROPPED + 1)

extern uint16_t status[STATUS_ITEMS];

#endif
