#include "board.h"

#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "flash.h"
#include "gyro.h"
#include "lines.h"
#include "motors.h"
#include "pins.h"
#include "sonars.h"

#define SUPPLY_MILLIVOLTS 5000
#define MCUSR 0x54
#define SPL 0x5D
#define ADDRESSES_END 0xFFFF
#define PORF 1
#define EXTRF 2
#define WDRF 8
#define SAVE_NS 100000000ull /* period of saving the EEPROM to its file */
/* `rjmp` to itself: a program that hangs with its interrupts running. */
#define HANG_LOW 0xFF
#define HANG_HIGH 0xCF

static void do_not_sleep(avr_t *avr, avr_cycle_count_t how_long)
{
    (void)avr;
    (void)how_long; /* simavr would wait in real time here; the caller of board_run paces */
}

static avr_cycle_count_t stop_here(avr_t *avr, avr_cycle_count_t when, void *value)
{
    (void)avr;
    (void)when;
    (void)value;
    return 0; /* the timer itself ends a sleep in time */
}

/* Level interrupts of a low pin would start a timer every cycle; the firmware uses none. */
static void quiet_interrupts(avr_t *avr)
{
    for (uint8_t number = 0; number < 8; number++)
        avr_extint_set_strict_lvl_trig(avr, number, 0);
}

static void start_trains(board_t *board);

/* After a reset of any cause all timers of simavr are gone. */
static void restarted(board_t *board)
{
    quiet_interrupts(board->avr);
    start_trains(board);
    sonars_reset(board);
    gyro_reset(board, board->avr->data[MCUSR] & PORF);
    lines_reset(board);
    board->flags |= FLAG_RESET;
    motors_poll(board);
}

void board_reset(board_t *board, uint8_t cause)
{
    avr_t *avr = board->avr;
    avr_cycle_count_t cycle = avr->cycle;
    avr_reset(avr);
    avr->cycle = cycle;
    avr->data[SPL] = (uint8_t)board->ram_end;
    avr->data[SPL + 1] = (uint8_t)(board->ram_end >> 8);
    avr->data[MCUSR] = cause;
    restarted(board);
}

void board_hang(board_t *board)
{
    uint32_t at = board->options.chip->hang;
    board->avr->flash[at] = HANG_LOW;
    board->avr->flash[at + 1] = HANG_HIGH;
    board->avr->pc = at;
    if (board->avr->state == cpu_Sleeping)
        board->avr->state = cpu_Running;
}

static void load_eeprom(board_t *board)
{
    uint8_t bytes[EEPROM_SIZE];
    FILE *file = board->options.eeprom ? fopen(board->options.eeprom, "rb") : NULL;
    memset(bytes, 0xFF, sizeof bytes);
    if (file) {
        size_t got = fread(bytes, 1, sizeof bytes, file);
        memset(bytes + got, 0xFF, sizeof bytes - got);
        fclose(file);
    }
    board_eeprom_set(board, bytes);
}

static void save_eeprom(board_t *board)
{
    uint8_t bytes[EEPROM_SIZE];
    if (!board->options.eeprom)
        return;
    board_eeprom_get(board, bytes);
    FILE *file = fopen(board->options.eeprom, "wb");
    if (!file || fwrite(bytes, 1, sizeof bytes, file) != sizeof bytes)
        perror(board->options.eeprom);
    if (file)
        fclose(file);
}

void board_eeprom_get(board_t *board, uint8_t *bytes)
{
    memset(bytes, 0xFF, EEPROM_SIZE);
    avr_eeprom_desc_t all = {.ee = bytes, .offset = 0, .size = board->options.chip->eeprom_size};
    avr_ioctl(board->avr, AVR_IOCTL_EEPROM_GET, &all);
}

void board_eeprom_set(board_t *board, const uint8_t *bytes)
{
    uint8_t copy[EEPROM_SIZE];
    memcpy(copy, bytes, sizeof copy);
    avr_eeprom_desc_t all = {.ee = copy, .offset = 0, .size = board->options.chip->eeprom_size};
    avr_ioctl(board->avr, AVR_IOCTL_EEPROM_SET, &all);
}

void board_begin(board_t *board, const options_t *options)
{
    board->options = *options;
    pins_begin(options->chip);
    avr_t *avr = board->avr = avr_make_mcu_by_name(options->chip->mcu);
    if (!avr) {
        fprintf(stderr, "simavr has no %s\n", options->chip->mcu);
        exit(1);
    }
    board->ram_end = avr->ramend;
    /* The stock bootloaders put a message of any length into their memory, and past its end. On the chip
       nothing is there (data sheet, section 8.3); simavr would call it a crash. */
    if (options->boot)
        avr->ramend = ADDRESSES_END;
    avr_init(avr);
    avr->frequency = 16000000;
    avr->log = LOG_NONE;
    avr->sleep = do_not_sleep;
    avr->vcc = avr->avcc = avr->aref = SUPPLY_MILLIVOLTS;
    memset(avr->flash, 0xFF, avr->flashend + 1);
    flash_begin(board);
    if (options->hex)
        flash_load(board, options->hex);
    if (options->boot) {
        avr->reset_pc = flash_load(board, options->boot); /* fuse BOOTRST, as delivered */
    }
    avr->codeend = avr->flashend; /* code that a bootloader writes is code */
    lines_begin(board);
    sonars_begin(board);
    gyro_begin(board);
    load_eeprom(board);
    board_reset(board, PORF);
}

void board_end(board_t *board)
{
    save_eeprom(board);
    lines_end(board);
}

static avr_cycle_count_t change(avr_t *avr, avr_cycle_count_t when, void *value)
{
    board_t *board = value;
    (void)when;
    while (board->first != board->last
           && ns_to_cycles(board->transitions[board->first].time) <= avr->cycle) {
        transition_t *next = &board->transitions[board->first];
        board->first = (board->first + 1) % TRANSITIONS;
        pins_drive(board->avr, next->pin, next->level);
    }
    if (board->first == board->last)
        return 0;
    return ns_to_cycles(board->transitions[board->first].time);
}

void board_transition(board_t *board, uint64_t time, uint8_t pin, uint8_t level)
{
    board->transitions[board->last] = (transition_t){time, pin, level};
    board->last = (board->last + 1) % TRANSITIONS;
}

static uint64_t random_bits(pulse_train_t *train)
{
    /* xorshift64: Marsaglia, "Xorshift RNGs" (2003) */
    train->random_state ^= train->random_state << 13;
    train->random_state ^= train->random_state >> 7;
    train->random_state ^= train->random_state << 17;
    return train->random_state;
}

static avr_cycle_count_t toggle(avr_t *avr, avr_cycle_count_t when, void *value)
{
    pulse_train_t *train = value;
    (void)avr;
    train->level = !train->level;
    pins_drive(train->board->avr, train->pin, train->level);
    uint32_t more = train->jitter ? random_bits(train) % (train->jitter + 1) : 0;
    return when + (train->level ? train->high : train->low) + more;
}

static void start_train(pulse_train_t *train)
{
    avr_cycle_timer_cancel(train->board->avr, toggle, train);
    if (train->high && train->low)
        avr_cycle_timer_register(train->board->avr, train->low, toggle, train);
}

static void start_trains(board_t *board)
{
    for (unsigned i = 0; i < PULSE_TRAINS; i++)
        if (board->trains[i].board)
            start_train(&board->trains[i]);
}

bool board_pulses(board_t *board, uint8_t pin, uint32_t high, uint32_t low, uint32_t jitter)
{
    pulse_train_t *train = NULL;
    for (unsigned i = 0; i < PULSE_TRAINS && !train; i++)
        if (!board->trains[i].board || board->trains[i].pin == pin)
            train = &board->trains[i];
    if (!train)
        return false;
    *train = (pulse_train_t){.board = board, .pin = pin, .random_state = pin + 1u,
                             .high = (uint32_t)ns_to_cycles(high), .low = (uint32_t)ns_to_cycles(low),
                             .jitter = (uint32_t)ns_to_cycles(jitter)};
    start_train(train);
    return true;
}

void board_analog(board_t *board, uint8_t channel, uint16_t millivolts)
{
    if (channel < 8) /* simavr's channels 8 to 15 do not work */
        avr_raise_irq(avr_io_getirq(board->avr, AVR_IOCTL_ADC_GETIRQ, channel), millivolts);
}

static void begin_transitions(board_t *board)
{
    avr_cycle_count_t now = board->avr->cycle;
    if (board->first == board->last)
        return;
    avr_cycle_count_t when = ns_to_cycles(board->transitions[board->first].time);
    avr_cycle_timer_cancel(board->avr, change, board);
    avr_cycle_timer_register(board->avr, when > now ? when - now : 1, change, board);
}

static void begin_step(board_t *board, avr_cycle_count_t end)
{
    begin_transitions(board);
    if (end > board->avr->cycle)
        avr_cycle_timer_register(board->avr, end - board->avr->cycle, stop_here, board);
}

void board_run(board_t *board, uint64_t until)
{
    avr_t *avr = board->avr;
    avr_cycle_count_t end = ns_to_cycles(until);
    if (lines_opened(board))
        board_reset(board, EXTRF);
    lines_poll(board);
    begin_step(board, end);
    while (avr->cycle < end) {
        bool slept = avr->state == cpu_Sleeping;
        uint8_t was_watched = avr->data[MCUSR];
        avr_cycle_count_t before = avr->cycle;
        int state = avr_run(avr);
        if (avr->data[MCUSR] & WDRF && !(was_watched & WDRF)) {
            avr->cycle = before;
            restarted(board);
            begin_step(board, end);
        }
        if (state == cpu_Crashed || state == cpu_Done) {
            board->flags |= FLAG_CRASHED;
            break;
        }
        if (state == cpu_Sleeping && !slept)
            motors_poll(board);
    }
    motors_poll(board);
    if (board->options.eeprom && until - board->eeprom_saved > SAVE_NS) {
        board->eeprom_saved = until;
        save_eeprom(board);
    }
}
