// run_sketch SKETCH.elf SECONDS OUT.vcd [AT TEXT]...: runs a sketch on a simulated Uno, writes what Timer1 does to a VCD
// file, and sends each TEXT and a line feed to its serial port at AT seconds. `oc1a` and `oc1b` are the pins (digital 9 and
// 10). simavr 1.6 keeps the first width of a pulse for ever: it does not see that a compare register was written while
// the timer counts to ICR1. So the registers themselves are in the trace too (`ocr1a`, `ocr1b`), at every write: on a
// chip the next pulse is as wide as that.
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_vcd_file.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char **argv) {
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    if (argc < 4 || elf_read_firmware(argv[1], &firmware) != 0) {
        fprintf(stderr, "usage: run_sketch SKETCH.elf SECONDS OUT.vcd [AT TEXT]...\n");
        return 2;
    }
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    if (!avr) return 1;
    avr_init(avr);
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    avr_vcd_t vcd;
    avr_vcd_init(avr, argv[3], &vcd, 1000);
    avr_vcd_add_signal(&vcd, avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 1), 1, "oc1a");
    avr_vcd_add_signal(&vcd, avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 2), 1, "oc1b");
    avr_irq_t *timer = avr_io_getirq(avr, AVR_IOCTL_TIMER_GETIRQ('1'), 0);
    avr_vcd_add_signal(&vcd, timer + TIMER_IRQ_OUT_PWM0, 16, "ocr1a");
    avr_vcd_add_signal(&vcd, timer + TIMER_IRQ_OUT_PWM1, 16, "ocr1b");
    avr_vcd_start(&vcd);
    avr_irq_t *serial = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    const avr_cycle_count_t end = (avr_cycle_count_t)(atof(argv[2]) * 16e6);
    int next = 4;
    const char *sending = NULL;
    avr_cycle_count_t due = 0;
    while (avr->cycle < end) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return 1;
        if (!sending && next + 1 < argc && avr->cycle >= (avr_cycle_count_t)(atof(argv[next]) * 16e6)) {
            sending = argv[next + 1];
            next += 2;
        }
        if (sending && avr->cycle >= due) {
            avr_raise_irq(serial, *sending ? (unsigned char)*sending : '\n');
            due = avr->cycle + 3200;  // a character at 115200 baud takes 87 us: 200 are safe
            sending = *sending ? sending + 1 : NULL;
        }
    }
    avr_vcd_stop(&vcd);
    return 0;
}
