#include "status.h"

uint16_t status[STATUS_ITEMS];
