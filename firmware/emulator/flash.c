#include <fcntl.h>
#include <simavr/avr_flash.h>
#include <simavr/sim_hex.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "flash.h"

#define SPMCSR 0x57 /* data address */
enum { SPMEN = 1, PGERS = 2, PGWRT = 4, BLBSET = 8, RWWSRE = 16 };

/* Replaces simavr's SPM, which lets a write set bits and does not align erasing. */
static int store(avr_io_t *io, uint32_t request, void *value)
{
    (void)value;
    if (request != AVR_IOCTL_FLASH_SPM)
        return -1;
    flash_t *flash = (flash_t *)io;
    avr_t *avr = flash->board->avr;
    uint32_t z = avr->data[R_ZL] | (uint32_t)avr->data[R_ZH] << 8
        | (avr->rampz ? (uint32_t)avr->data[avr->rampz] << 16 : 0);
    uint32_t size = flash->board->options.chip->page;
    uint8_t *page = avr->flash + (z & ~(size - 1) & avr->flashend);
    uint8_t control = avr->data[SPMCSR];
    if (control & PGERS) {
        memset(page, 0xFF, size);
    } else if (control & PGWRT) {
        for (unsigned i = 0; i < size / 2; i++) {
            if (!flash->filled[i])
                continue;
            uint8_t low = (uint8_t)flash->page[i], high = (uint8_t)(flash->page[i] >> 8);
            if ((page[2 * i] & low) != low || (page[2 * i + 1] & high) != high)
                flash->board->dirty_writes++;
            page[2 * i] &= low;
            page[2 * i + 1] &= high;
        }
        memset(flash->filled, 0, sizeof flash->filled);
    } else if (control & (RWWSRE | BLBSET)) {
        memset(flash->filled, 0, sizeof flash->filled);
    } else if (control & SPMEN) {
        unsigned word = (z & (size - 1)) / 2;
        flash->page[word] = (uint16_t)(avr->data[0] | avr->data[1] << 8);
        flash->filled[word] = true;
    }
    avr->data[SPMCSR] &= (uint8_t)~(SPMEN | PGERS | PGWRT | BLBSET | RWWSRE);
    return 0;
}

void flash_begin(board_t *board)
{
    flash_t *flash = &board->flash;
    flash->board = board;
    flash->io = (avr_io_t){.kind = "flash", .ioctl = store};
    avr_register_io(board->avr, &flash->io); /* found before simavr's own */
}

/* Suppresses simavr's messages about records with a start address, which an AVR does not use. */
static int read_quietly(const char *file, ihex_chunk_p *chunks)
{
    int saved_stderr = dup(STDERR_FILENO), null_device = open("/dev/null", O_WRONLY);
    dup2(null_device, STDERR_FILENO);
    int count = read_ihex_chunks(file, chunks);
    dup2(saved_stderr, STDERR_FILENO);
    close(null_device);
    close(saved_stderr);
    return count;
}

uint32_t flash_load(board_t *board, const char *file)
{
    ihex_chunk_p chunks = NULL;
    int count = read_quietly(file, &chunks);
    if (count <= 0) {
        fprintf(stderr, "%s: no Intel hex file\n", file);
        exit(1);
    }
    uint32_t lowest = board->avr->flashend;
    for (int i = 0; i < count; i++) {
        if (chunks[i].baseaddr + chunks[i].size > board->avr->flashend + 1) {
            fprintf(stderr, "%s: larger than the flash\n", file);
            exit(1);
        }
        memcpy(board->avr->flash + chunks[i].baseaddr, chunks[i].data, chunks[i].size);
        if (chunks[i].baseaddr < lowest)
            lowest = chunks[i].baseaddr;
    }
    free_ihex_chunks(chunks);
    return lowest;
}
