// count_pulses SKETCH.elf SECONDS: runs a sketch on a simulated Uno and prints a line for every rising
// edge of STEP (digital pin 2): the time in CPU cycles and the level of DIR (digital pin 3).
#include <simavr/avr_ioport.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static avr_t *avr;
static unsigned direction;

static void on_direction(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    (void)param;
    direction = value;
}

static void on_step(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    (void)param;
    if (value) printf("%llu %u\n", (unsigned long long)avr->cycle, direction);
}

int main(int argc, char **argv) {
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    if (argc != 3 || elf_read_firmware(argv[1], &firmware) != 0) {
        fprintf(stderr, "usage: count_pulses SKETCH.elf SECONDS\n");
        return 2;
    }
    avr = avr_make_mcu_by_name("atmega328p");
    if (!avr) return 1;
    avr_init(avr);
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 2), on_step, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 3), on_direction, NULL);
    const avr_cycle_count_t end = (avr_cycle_count_t)(atof(argv[2]) * 16e6);
    while (avr->cycle < end) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return 1;
    }
    return 0;
}
