# SPDX-License-Identifier: Apache-2.0
"""From shots to models, and from models to other runtimes: training and export."""
