#!/usr/bin/env bash
# compile_sketch.sh SKETCH.ino OUT.elf: compiles a sketch for an Arduino Uno with Debian's avr-gcc and
# Arduino core. Warnings in the sketch are errors; the core's own are not our business.
set -euo pipefail
sketch=$1
elf=$2
pins=$(dpkg -L arduino-core-avr | grep '/variants/standard/pins_arduino.h$')
hardware=${pins%/variants/standard/pins_arduino.h}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
flags=(-mmcu=atmega328p -DF_CPU=16000000L -DARDUINO=10819 -DARDUINO_AVR_UNO -DARDUINO_ARCH_AVR
    -Os -ffunction-sections -fdata-sections -I"$hardware/cores/arduino" -I"$hardware/variants/standard" ${SKETCH_FLAGS:-})
avr-g++ "${flags[@]}" -std=gnu++14 -fno-exceptions -fno-threadsafe-statics \
    -Wall -Wextra -Werror -x c++ -c "$sketch" -o "$work/sketch.o"
for source in "$hardware"/cores/arduino/*.{c,cpp,S}; do
    object=$work/$(basename "$source").o
    case $source in
        *.c) avr-gcc "${flags[@]}" -std=gnu11 -w -c "$source" -o "$object" ;;
        *.cpp) avr-g++ "${flags[@]}" -std=gnu++11 -DDECIMAL_DIG=__DECIMAL_DIG__ -fpermissive -fno-exceptions -fno-threadsafe-statics -w -c "$source" -o "$object" ;;
        *.S) avr-gcc "${flags[@]}" -x assembler-with-cpp -c "$source" -o "$object" ;;
    esac
done
avr-gcc -mmcu=atmega328p -Os -Wl,--gc-sections "$work"/*.o -lm -o "$elf"
avr-size "$elf"
