/* Data sheet figures: a trigger of at least 10 us; 0.45 ms later the burst has left and the echo pin goes
   high, until the burst returns, or for 38 ms. A burst of another sensor ends the echo too. */
#include "sonars.h"

#include <simavr/avr_ioport.h>

#include "pins.h"

#define CYCLES_PER_US 16
#define TRIGGER (10 * CYCLES_PER_US)
#define BURST (450 * CYCLES_PER_US)
#define LONGEST (38000 * CYCLES_PER_US)

static avr_cycle_count_t end_echo(avr_t *avr, avr_cycle_count_t when, void *value)
{
    sonar_t *sonar = value;
    (void)when;
    sonar->listens = false;
    pins_drive(avr, sonar->echo, 0);
    return 0;
}

/* The burst that left `sender` at `sent` arrives at a sensor that listens: the first one ends its echo. */
static void receive(sonar_t *sonar, const sonar_t *sender, avr_cycle_count_t sent)
{
    avr_t *avr = sonar->board->avr;
    avr_cycle_count_t arrival = sent + sender->width;
    if (sender->width == SONAR_SILENT || arrival <= avr->cycle)
        return;
    avr_cycle_count_t pending = avr_cycle_timer_status(avr, end_echo, sonar);
    if (pending && avr->cycle + pending <= arrival)
        return;
    avr_cycle_timer_cancel(avr, end_echo, sonar);
    avr_cycle_timer_register(avr, arrival - avr->cycle, end_echo, sonar);
}

static avr_cycle_count_t begin_echo(avr_t *avr, avr_cycle_count_t when, void *value)
{
    sonar_t *sonar = value;
    board_t *board = sonar->board;
    (void)when;
    sonar->sent = avr->cycle;
    sonar->listens = true;
    pins_drive(avr, sonar->echo, 1);
    if (sonar->width == SONAR_ENDLESS)
        return 0;
    avr_cycle_timer_register(avr, LONGEST, end_echo, sonar);
    for (unsigned i = 0; i < board->options.sonars; i++) {
        sonar_t *other = &board->sonars[i];
        if (other->sent)
            receive(sonar, other, other->sent);
        if (other != sonar && other->listens && other->width != SONAR_ENDLESS)
            receive(other, sonar, sonar->sent);
    }
    return 0;
}

static void triggered(avr_irq_t *irq, uint32_t value, void *parameter)
{
    sonar_t *sonar = parameter;
    avr_t *avr = sonar->board->avr;
    (void)irq;
    if (value && !sonar->is_triggered)
        sonar->raised = avr->cycle;
    if (!value && sonar->is_triggered && avr->cycle - sonar->raised >= TRIGGER && !sonar->listens
        && sonar->width != SONAR_SILENT)
        avr_cycle_timer_register(avr, BURST, begin_echo, sonar);
    sonar->is_triggered = value != 0;
}

void sonars_begin(board_t *board)
{
    for (unsigned i = 0; i < board->options.sonars; i++) {
        sonar_t *sonar = &board->sonars[i];
        *sonar = (sonar_t){.board = board, .trigger = board->options.sonar[i][0],
                           .echo = board->options.sonar[i][1]};
        place_t place = pin_place(sonar->trigger);
        avr_irq_t *irq =
            avr_io_getirq(board->avr, AVR_IOCTL_IOPORT_GETIRQ(place.port), place.bit);
        if (irq)
            avr_irq_register_notify(irq, triggered, sonar);
    }
}

void sonars_reset(board_t *board)
{
    for (unsigned i = 0; i < board->options.sonars; i++) {
        board->sonars[i].listens = board->sonars[i].is_triggered = false;
        pins_drive(board->avr, board->sonars[i].echo, 0);
    }
}

void sonars_set(board_t *board, unsigned sonar, uint16_t us)
{
    if (sonar < board->options.sonars)
        board->sonars[sonar].width = us == SONAR_ENDLESS ? us : us * CYCLES_PER_US;
}
