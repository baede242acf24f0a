/* The settings in the RP2040's flash memory, of which three sectors are used: one for each slot, one that
   counts power-ups, a byte for each. The program runs from RAM, so the flash is not needed as memory and
   the chip erases and writes it in the background, by its plain serial commands. */
#include "board.h"
#include "rp2040_registers.h"

#define SECTOR 4096u
#define SECTORS 0x1FD000u /* the last three of 2 MB */
#define SLOTS 2
#define POWER_UPS (SLOTS * BOARD_STORE_SLOT) /* address of their number */
#define ERASED 0xFF

/* Commands that all chips of this kind know (data sheet of the W25Q16JV). */
enum { WRITE_PAGE = 0x02, READ_STATUS = 0x05, ENABLE_WRITING = 0x06, ERASE_SECTOR = 0x20, READ_IDENTITY = 0x4B };
#define BYTES_BEFORE_IDENTITY 4
#define BUSY 1

#define SELECTED (2u << 8) /* select line low, and high */
#define DESELECTED (3u << 8)
#define PLAIN_8_BITS (7u << 16) /* sends and receives bytes */
#define DIVISOR 8 /* 6 MHz */
#define RECEIVED (1u << 3)

/* Content of the sectors, which cannot be read as memory any more. */
static uint8_t bytes[POWER_UPS + 1];

static uint8_t exchange(uint8_t byte)
{
    REGISTER(SSI + SSI_DATA) = byte;
    while (!(REGISTER(SSI + SSI_STATUS) & RECEIVED))
        ;
    return (uint8_t)REGISTER(SSI + SSI_DATA);
}

/* Sends a command and `count` bytes; returns the answer to the last. */
static uint8_t command(uint8_t code, const uint8_t *data, uint8_t count)
{
    REGISTER(SELECT_CTRL) = SELECTED;
    uint8_t answer = exchange(code);
    while (count--)
        answer = exchange(*data++);
    REGISTER(SELECT_CTRL) = DESELECTED;
    return answer;
}

/* The number that the memory was made with; no other has it. */
void rp2040_read_identity(uint8_t *identity)
{
    REGISTER(SELECT_CTRL) = SELECTED;
    exchange(READ_IDENTITY);
    for (uint8_t i = 0; i < BYTES_BEFORE_IDENTITY; i++)
        exchange(0);
    for (uint8_t i = 0; i < IDENTITY_BYTES; i++)
        identity[i] = exchange(0);
    REGISTER(SELECT_CTRL) = DESELECTED;
}

static void change(uint8_t code, uint32_t at, uint8_t byte)
{
    uint8_t data[] = {(uint8_t)(at >> 16), (uint8_t)(at >> 8), (uint8_t)at, byte};
    command(ENABLE_WRITING, 0, 0);
    command(code, data, code == WRITE_PAGE ? 4 : 3);
}

static uint32_t place(uint16_t address)
{
    return SECTORS + address / BOARD_STORE_SLOT * SECTOR + address % BOARD_STORE_SLOT;
}

static uint8_t power_ups(void)
{
    const uint8_t *at = (const uint8_t *)(FLASH + place(POWER_UPS));
    uint8_t count = 0;
    while (count < UINT8_MAX && *at++ != ERASED)
        count++;
    return count;
}

void rp2040_begin_store(void)
{
    for (uint16_t i = 0; i < POWER_UPS; i++)
        bytes[i] = *(const uint8_t *)(FLASH + place(i));
    bytes[POWER_UPS] = power_ups();
    REGISTER(SELECT_CTRL) = DESELECTED;
    REGISTER(SSI + SSI_ENABLE) = 0;
    REGISTER(SSI + SSI_DIVISOR) = DIVISOR;
    REGISTER(SSI + SSI_CONTROL) = PLAIN_8_BITS;
    REGISTER(SSI + SSI_SLAVE) = 1;
    REGISTER(SSI + SSI_ENABLE) = 1;
}

void board_store_read(uint16_t address, void *to, uint8_t size)
{
    for (uint8_t *at = to; size--; address++)
        *at++ = bytes[address];
}

bool board_store_ready(void)
{
    const uint8_t nothing = 0;
    return !(command(READ_STATUS, &nothing, 1) & BUSY);
}

void board_store_clear(uint16_t slot)
{
    for (uint16_t i = 0; i < BOARD_STORE_SLOT; i++)
        bytes[slot + i] = ERASED;
    change(ERASE_SECTOR, place(slot), 0);
}

/* The number of power-ups grows by one, so one byte is written for it; from 255 on it starts again. */
void board_store_write(uint16_t address, uint8_t byte)
{
    bytes[address] = byte;
    if (address != POWER_UPS)
        change(WRITE_PAGE, place(address), byte);
    else if (byte == 0)
        change(ERASE_SECTOR, place(address), 0);
    else
        change(WRITE_PAGE, place(address) + byte - 1, 0);
}
