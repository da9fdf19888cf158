// Stand-in for pluginlib: the class must be a base's, and can be made.
#pragma once

#include <memory>

#define PLUGINLIB_EXPORT_CLASS(CLASS, BASE) \
  std::unique_ptr<BASE> make_exported_class() { return std::make_unique<CLASS>(); }
