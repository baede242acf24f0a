#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/inotify.h>
#include <termios.h>
#include <unistd.h>

#include "lines.h"

#define QUEUE 65536u
#define BITS_PER_BYTE 10
#define SHORT_BYTE 16 /* cycles */
#define CPU_HZ 16000000

/* Data addresses of UCSRnA. */
static const uint16_t registers[2] = {0xC0, 0xC8};

/* simavr always counts a parity bit; this counts start, eight data bits, stop. */
static avr_cycle_count_t byte_cycles(const line_t *line)
{
    const uint8_t *uart = line->board->avr->data + registers[line->number];
    unsigned divisor = (uart[4] | (uart[5] & 15u) << 8) + 1;
    bool doubled = uart[0] & 2;
    return (avr_cycle_count_t)divisor * (doubled ? 8 : 16) * BITS_PER_BYTE;
}

static avr_uart_t *uart_of(avr_t *avr, unsigned number)
{
    for (avr_io_t *io = avr->io_port; io; io = io->next)
        if (io->kind && !strcmp(io->kind, "uart") && ((avr_uart_t *)io)->name == (char)('0' + number))
            return (avr_uart_t *)io;
    fprintf(stderr, "simavr has no UART%u\n", number);
    exit(1);
}

static void correct_speed(line_t *line)
{
    uart_of(line->board->avr, line->number)->cycles_per_byte = byte_cycles(line);
}

/* A byte is complete. simavr would wait the time of the byte once more, and may never raise the
   interrupt when the next byte comes before this one was read: so give it a very short byte time. */
static void arrived(line_t *line, uint8_t byte)
{
    avr_uart_t *uart = uart_of(line->board->avr, line->number);
    uart->cycles_per_byte = SHORT_BYTE;
    avr_raise_irq(line->input, byte);
    uart->cycles_per_byte = byte_cycles(line);
}

static avr_cycle_count_t feed(avr_t *avr, avr_cycle_count_t when, void *value)
{
    line_t *line = value;
    (void)avr;
    if (line->head == line->tail) {
        line->feeding = false;
        return 0;
    }
    arrived(line, line->waiting[line->tail]);
    line->tail = (line->tail + 1) % QUEUE;
    if (line->head == line->tail) {
        line->feeding = false;
        return 0;
    }
    return when + byte_cycles(line);
}

void lines_receive(board_t *board, unsigned number, const uint8_t *bytes, unsigned count)
{
    line_t *line = &board->uarts[number];
    for (unsigned i = 0; i < count; i++) {
        line->waiting[line->head] = bytes[i];
        line->head = (line->head + 1) % QUEUE;
    }
    if (count && !line->feeding) {
        line->feeding = true;
        avr_cycle_timer_register(board->avr, byte_cycles(line), feed, line);
    }
}

/* Baud rate that the client of a pseudo-terminal has set; 0 for one without a number here. */
static unsigned client_baud(const line_t *line)
{
    static const struct {
        speed_t speed;
        unsigned baud;
    } speeds[] = {{B9600, 9600}, {B19200, 19200}, {B38400, 38400}, {B57600, 57600}, {B115200, 115200}};
    struct termios settings;
    if (tcgetattr(line->slave, &settings))
        return 0;
    for (unsigned i = 0; i < sizeof speeds / sizeof *speeds; i++)
        if (speeds[i].speed == cfgetospeed(&settings))
            return speeds[i].baud;
    return 0;
}

/* What the receiver makes of a byte sent at another rate: on the USB port, bits of another byte. On the
   radio's port the rate of the client does not matter: Bluetooth has none. */
static uint8_t as_received(const line_t *line, uint8_t byte)
{
    unsigned baud = client_baud(line);
    avr_cycle_count_t cycles = byte_cycles(line);
    uint64_t expected = baud ? (uint64_t)CPU_HZ * BITS_PER_BYTE / baud : cycles;
    bool same = expected * 100 < cycles * 104 && cycles * 100 < expected * 104;
    return same || line->number != 0 ? byte : (uint8_t)~(byte << 1);
}

/* simavr reports a byte at its start bit; it is complete one byte time later. */
static void sent(avr_irq_t *irq, uint32_t value, void *parameter)
{
    line_t *line = parameter;
    board_t *board = line->board;
    (void)irq;
    correct_speed(line);
    if (line->master >= 0) {
        uint8_t byte = as_received(line, (uint8_t)value);
        if (write(line->master, &byte, 1) < 0 && errno != EAGAIN && errno != EIO)
            perror("pseudo-terminal");
        return;
    }
    if (board->byte_count < BYTES) {
        board->bytes[board->byte_count].time =
            cycles_to_ns(board->avr->cycle + byte_cycles(line));
        board->bytes[board->byte_count].uart = (uint8_t)line->number;
        board->bytes[board->byte_count++].byte = (uint8_t)value;
    }
}

static void configured(avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    (void)value;
    correct_speed(parameter);
}

static void open_pty(line_t *line)
{
    struct termios raw;
    line->master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (line->master < 0 || grantpt(line->master) || unlockpt(line->master)
        || ptsname_r(line->master, line->name, sizeof line->name)) {
        perror("pseudo-terminal");
        exit(1);
    }
    /* With the slave open here, its settings stay when the last client closes it. */
    line->slave = open(line->name, O_RDWR | O_NOCTTY);
    tcgetattr(line->slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(line->slave, TCSANOW, &raw);
    if (line->number != 0)
        return;
    line->watch = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    inotify_add_watch(line->watch, line->name, IN_OPEN);
}

void lines_begin(board_t *board)
{
    for (unsigned number = 0; number < board->options.chip->uarts; number++) {
        line_t *line = &board->uarts[number];
        uint32_t flags = 0; /* no sleeping when polled, no echo to standard output */
        line->board = board;
        line->number = number;
        line->master = line->slave = line->watch = -1;
        avr_ioctl(board->avr, (uint32_t)AVR_IOCTL_UART_SET_FLAGS('0' + number), &flags);
        uint32_t get = (uint32_t)AVR_IOCTL_UART_GETIRQ('0' + number);
        line->input = avr_io_getirq(board->avr, get, UART_IRQ_INPUT);
        avr_irq_register_notify(avr_io_getirq(board->avr, get, UART_IRQ_OUTPUT), sent, line);
        avr_irq_register_notify(
            avr_iomem_getirq(board->avr, registers[number] + 4, NULL, AVR_IOMEM_IRQ_ALL),
            configured, line);
        if (board->options.pty)
            open_pty(line);
    }
}

void lines_reset(board_t *board)
{
    for (unsigned number = 0; number < board->options.chip->uarts; number++) {
        line_t *line = &board->uarts[number];
        line->feeding = false; /* the reset removed the timer */
        line->head = line->tail = 0;
    }
}

bool lines_opened(board_t *board)
{
    const line_t *line = &board->uarts[0];
    struct inotify_event events[8];
    bool opened = false;
    while (line->watch >= 0 && read(line->watch, events, sizeof events) > 0)
        opened = true;
    return opened;
}

static void poll_line(line_t *line)
{
    uint8_t bytes[256];
    ssize_t got;
    unsigned room = (line->tail - line->head - 1) % QUEUE;
    if (room > sizeof bytes)
        room = sizeof bytes;
    got = read(line->master, bytes, room);
    for (ssize_t i = 0; i < got; i++)
        bytes[i] = as_received(line, bytes[i]);
    if (got > 0)
        lines_receive(line->board, line->number, bytes, (unsigned)got);
}

void lines_poll(board_t *board)
{
    for (unsigned number = 0; number < board->options.chip->uarts; number++)
        if (board->uarts[number].master >= 0)
            poll_line(&board->uarts[number]);
}

void lines_end(board_t *board)
{
    for (unsigned number = 0; number < board->options.chip->uarts; number++)
        if (board->uarts[number].master >= 0) {
            close(board->uarts[number].slave);
            close(board->uarts[number].master);
            if (board->uarts[number].watch >= 0)
                close(board->uarts[number].watch);
        }
}
