// What the sketches use of the public interface of ROBOTIS' library Dynamixel2Arduino, written anew from its
// documentation so that they can be compiled where the library is not installed. It moves nothing: that a sketch compiles
// against it says that names and types are right, not that a servo answers.
#pragma once
#include <Arduino.h>

enum OperatingMode : uint8_t { OP_POSITION = 0, OP_EXTENDED_POSITION, OP_VELOCITY = 4 };
enum ParamUnit : uint8_t { UNIT_RAW = 0, UNIT_PERCENT, UNIT_RPM, UNIT_DEGREE };

class Dynamixel2Arduino {
 public:
  Dynamixel2Arduino(HardwareSerial &port, int dir_pin = -1) { (void)port, (void)dir_pin; }
  void begin(unsigned long baud = 57600) { (void)baud; }
  bool setPortProtocolVersion(float version) { return version == 2.0f; }
  bool ping(uint8_t id) { return id != 0; }
  bool torqueOn(uint8_t id) { return id != 0; }
  bool torqueOff(uint8_t id) { return id != 0; }
  bool setOperatingMode(uint8_t id, uint8_t mode) { return id != 0 && mode != 0xff; }
  bool setGoalPosition(uint8_t id, float value, uint8_t unit = UNIT_RAW) {
    Serial.print(id), Serial.print(' '), Serial.println(value, 0);  // what a test may read
    return unit == UNIT_RAW;
  }
  float getPresentPosition(uint8_t id, uint8_t unit = UNIT_RAW) { return id == 0 || unit != UNIT_RAW ? -1.0f : 2048.0f; }
};
